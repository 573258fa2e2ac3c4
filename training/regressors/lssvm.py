"""Least squares support vector regression with several outputs: exact, and of a fixed size."""

from __future__ import annotations

from typing import ClassVar, final

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.builder import Graph
from training.regressors.exact_solution import ExactSolution
from training.regressors.fixed_size_solution import FixedSizeSolution
from training.regressors.gaussian_regressor import GaussianRegressor, Progress, Requirements
from training.regressors.rbf_expansion import Expansion, rbf
from training.regressors.row_groups import Groups

#: Most training rows that are solved exactly unless the solution is stated: 1.7 GB, some minutes.
MOST_EXACT_ROWS = 20_000
#: Elements of the kernel matrix that a prediction computes at a time.
PREDICTED_AT_A_TIME = 500_000


class LSSVM(GaussianRegressor):
    r"""Least squares support vector regression with bias, Gaussian kernel, any number of outputs.

    .. math:: f(x) = \sum_j \alpha_j k(x, c_j) + b

    Parameters
    ----------
    solution : {"by-rows", "exact", "fixed-size"}
        "exact" has a prototype for each row; its time grows with the cube of the number of rows and
        its memory with the square. "fixed-size" has `centres` prototypes, see `FixedSizeLSSVM`; its
        time is proportional to the number of rows. "by-rows" is exact up to 20 000 rows.
    centres : int
        Prototypes of the fixed-size solution.
    gamma : float, optional
        Weight of the errors against smoothness; selected if None, by the error on rows left out,
        in closed form.
    width : float, optional
        Kernel width in standardised inputs; selected in the same way if None.
    random_state : int
        Seed of the rows on which they are selected, and of the prototypes.

    Notes
    -----
    The log-variance is a second expansion on the same kernel, fitted to the logarithms of the
    squared residuals of rows that were left out.

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

    expansion_: Expansion  # centres and weights in standardised units, and how they were selected

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

    @final
    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        self.expansion_ = self.solution_for(len(x)).solve(x, z, groups, progress)

    @final
    def _left_out(
        self, x: Floats, z: Floats, groups: Groups, progress: Progress
    ) -> tuple[Floats, Floats]:
        """In closed form, as part of the solution."""
        return self.expansion_.left_out

    @final
    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        found = self.expansion_
        weights = np.hstack([found.alpha, found.log_variance_alpha])
        chunk = max(PREDICTED_AT_A_TIME // len(found.centres), 1)
        parts = [
            rbf(x[i : i + chunk], found.centres, found.width) @ weights
            for i in range(0, len(x), chunk)
        ]
        mean, log_variance = np.split(np.vstack(parts), 2, axis=1)
        return mean + found.bias, log_variance + found.log_variance_bias

    @final
    def _input_factor(self) -> float:
        """With x and centres divided by sqrt(2) width the kernel is exp(-|x - c|^2)."""
        return float(1.0 / (np.sqrt(2.0) * self.expansion_.width))

    @final
    def _add_standardised_outputs(self, graph: Graph, x: str) -> tuple[str, str]:
        found = self.expansion_
        squared = graph.squared_distances(x, found.centres * self._input_factor())
        kernel = graph.op("Exp", graph.op("Neg", squared))
        q = found.alpha.shape[1]
        weights = np.hstack([found.alpha, found.log_variance_alpha])
        bias = np.concatenate([found.bias, found.log_variance_bias])
        both = graph.affine(kernel, weights, bias)
        return graph.columns(both, 0, q), graph.columns(both, q, 2 * q)

    @final
    def requirements(self, rows: int, inputs: int, outputs: int) -> Requirements:
        """Number of prototypes, and the memory of the solution."""
        solution = self.solution_for(rows)
        size = f"{solution.name}, {solution.prototypes(rows)} prototypes"
        return Requirements(size, solution.bytes(rows, inputs, outputs))

    @final
    def fitted_settings(self) -> str:
        """Solution, number of centres, gamma and width."""
        e = self.expansion_
        return f"{e.solution}, {len(e.centres)} centres, gamma {e.gamma:.3g}, width {e.width:.3g}"


class FixedSizeLSSVM(LSSVM):
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
    choices: ClassVar[dict[str, tuple[str, ...]]] = {}
    solution = "fixed-size"

    def __init__(
        self,
        centres: int = 150,
        gamma: float | None = None,
        width: float | None = None,
        random_state: int = 0,
    ) -> None:
        self.centres, self.random_state = centres, random_state
        self.gamma, self.width = gamma, width
