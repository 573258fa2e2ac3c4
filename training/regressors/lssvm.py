"""Least squares support vector regression with several outputs: exact, and of a fixed size."""

from __future__ import annotations

from typing import Any, ClassVar

from training.regressors.exact_solution import ExactSolution
from training.regressors.fixed_size_solution import FixedSizeSolution
from training.regressors.kernel_expansion import KernelExpansion


class FixedSizeLSSVM(KernelExpansion):
    """LS-SVM in the primal, on Nystrom features of a subset of the rows with large Renyi entropy.

    Rows are read in parts: time is proportional to their number, memory hardly depends on it.

    Parameters
    ----------
    centres : int
        Size of the subset, and of the exported model.
    gamma, width : float, optional
        As for `LSSVM`.
    random_state : int
        Seed of the selection of centres.

    Notes
    -----
    More centres reduce the error only while the function varies over less than their distance; the
    inverse problem from a single reading does not.

    References: Suykens et al., Least Squares Support Vector Machines, 2002, chapter 6; Williams and
    Seeger, NIPS 13, 2001 (Nystrom); De Brabanter et al., Computational Statistics and Data Analysis
    54(6), 2010 (large data sets).
    """

    type_name: ClassVar[str] = "fixed-size-lssvm"

    def __init__(
        self,
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.centres, self.random_state = centres, random_state
        self.gamma, self.width = gamma, width

    def solution_for(self, rows: int) -> FixedSizeSolution:
        """The fixed-size solution."""
        return FixedSizeSolution(self.centres, self.gamma, self.width, self.random_state)


#: Most training rows that are solved exactly unless the solution is stated: 1.7 GB, some minutes.
MOST_EXACT_ROWS = 20_000


class LSSVM(KernelExpansion):
    """Least squares support vector regression with bias, Gaussian kernel, any number of outputs.

    Parameters
    ----------
    solution : {"by-rows", "exact", "fixed-size"}
        "exact" has a prototype for each row; its time grows with the cube of the number of rows and
        its memory with the square. "fixed-size" has `centres` prototypes, see `FixedSizeLSSVM`; its
        time is proportional to the number of rows. "by-rows" is exact up to 20 000 rows.
    centres : int
        Prototypes of the fixed-size solution.
    gamma : float, optional
        Weight of the errors against smoothness; selected if None, by the error on validation rows,
        or where there are too few by closed-form leave-one-out.
    width : float, optional
        Kernel width in standardised inputs; selected in the same way if None.
    random_state : int
        Seed of the rows on which they are selected, and of the prototypes.

    Notes
    -----
    The log-variance is a second expansion on the same kernel, fitted to the logarithms of the
    squared leave-one-out residuals.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(0.0, 6.0, 40)[:, None]
    >>> mean = LSSVM().fit(x, np.sin(x[:, 0])).predict([[1.5]])
    >>> print(np.round(mean, 2))
    [1.]
    """

    type_name: ClassVar[str] = "lssvm"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"solution": ("by-rows", "exact", "fixed-size")}

    def __init__(
        self,
        solution: str = "by-rows",
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.solution = solution
        self.centres, self.random_state = centres, random_state
        self.gamma, self.width = gamma, width

    def solution_for(self, rows: int) -> ExactSolution | FixedSizeSolution:
        """The solution that is used for a number of training rows."""
        exact = self.solution == "exact" or (self.solution == "by-rows" and rows <= MOST_EXACT_ROWS)
        if exact:
            return ExactSolution(self.gamma, self.width, self.random_state)
        return FixedSizeSolution(self.centres, self.gamma, self.width, self.random_state)

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """Gamma, width and solution; None where fitting again takes too long."""
        fixed = super().learning_curve_parameters()
        return None if fixed is None else fixed | {"solution": self.expansion_.solution}
