"""Fixed-size least squares support vector regression: its size is independent of the data's."""

from __future__ import annotations

from typing import ClassVar

from training.regressors.kernel.fixed_size_solution import FixedSizeSolution
from training.regressors.kernel_expansion import KernelExpansion


class FixedSizeLSSVM(KernelExpansion):
    """LS-SVM in the primal, on Nystrom features of a subset of the rows with large Renyi entropy.

    Rows are read in parts: time is proportional to their number, memory hardly depends on it.

    Parameters
    ----------
    centres : int
        Size of the subset, and of the exported model.
    gamma, width : float or None
        As for `LSSVM`.
    random_state : int
        Seed of the selection of centres.

    Notes
    -----
    More centres reduce the error only while the function varies over less than their distance; the
    inverse problem from a single reading does not.

    References
    ----------
    Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; Williams and Seeger,
    NIPS 13, 2001 (Nystrom); De Brabanter et al., Computational Statistics and Data Analysis 54(6),
    2010 (large data sets).
    """

    type_name: ClassVar[str] = "fixed-size-lssvm"

    def __init__(
        self,
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.centres = centres
        self.gamma = gamma
        self.width = width
        self.random_state = random_state

    def solution_for(self, rows: int) -> FixedSizeSolution:
        """The fixed-size solution."""
        return FixedSizeSolution(self.centres, self.gamma, self.width, self.random_state)
