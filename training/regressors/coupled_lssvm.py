"""Multi-output least squares support vector regression: outputs with a shared and an own part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from soilml.errors import InputError
from training.regressors.exact_solution import (
    EIGENSYSTEM_ROWS,
    GAMMAS,
    WIDTHS,
    ExactSolution,
    KernelEigensystem,
)
from training.regressors.gaussian_regressor import Progress
from training.regressors.kernel_expansion import KernelExpansion
from training.regressors.rbf_expansion import (
    Expansion,
    Rows,
    log_squared_residuals,
    median_distance,
    rbf,
    usable_validation,
)

#: Shares of the variance of an output that its shared part has, among which one is selected. At 0
#: nothing is shared, as in `LSSVM`.
COUPLINGS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99)


@dataclass(frozen=True)
class CoupledSolution:
    """How a coupled LS-SVM is solved; gamma, width and coupling are selected if None."""

    gamma: float | None
    width: float | None
    coupling: float | None

    @property
    def name(self) -> str:
        """As in the spec."""
        return "coupled"

    def solve(self, x: Floats, z: Floats, validation: Rows | None, progress: Progress) -> Expansion:
        r"""The expansion for standardised inputs (n, d) and outputs (n, q).

        Outputs are :math:`f_i = s_i w_0^T \varphi(x) + v_i^T \varphi(x) + b_i`, with signs s of the
        first principal component of the outputs. With the shared part's share c of the variance,
        the kernel of outputs i and j is

        .. math:: k(x, x') B_{ij}, \qquad B = (1 - c) I + c \, s s^T

        B has the eigenvalue 1 + (q - 1) c along s, and 1 - c across it: in the coordinates of its
        eigenvectors the joint system falls apart into one LS-SVM each, with gamma times the
        eigenvalue. The residuals of rows left out, all outputs of a row at once, are therefore
        closed-form as well, and turn back like the outputs.

        Raises `InputError` for more rows than an eigensystem is computed of, and for a coupling
        outside of 0 to 1.

        References: Xu et al., "Multi-output least-squares support vector regression machines",
        Pattern Recognition Letters 34(9), 2013, whose lambda is q (1 - c) / c.
        """
        if self.coupling is not None and not 0.0 <= self.coupling < 1.0:
            raise InputError(f"coupling is {self.coupling:g}; needed is a number from 0 to below 1")
        if len(x) > EIGENSYSTEM_ROWS:
            raise InputError(
                f"coupled-lssvm has {len(x)} rows; needed are at most {EIGENSYSTEM_ROWS}, for more "
                "use type = 'lssvm'"
            )
        turn = _along_and_across(z)
        with threadpool_limits(1):
            system, search, (width, gamma, coupling) = self._select(
                x, z @ turn, usable_validation(validation), turn
            )
            alpha, bias, residual = (
                part @ turn.T for part in _solved(system, z @ turn, gamma, coupling)
            )
            logs = log_squared_residuals(residual)
            log_gamma = GAMMAS[int(np.argmin(system.leave_one_out_errors(logs, GAMMAS)))]
            log_alpha, log_bias, _ = system.solve(logs, log_gamma)
        return Expansion(
            solution=f"shared part {coupling:g} of the variance",
            centres=x,
            width=width,
            gamma=gamma,
            alpha=alpha,
            bias=bias,
            log_variance_alpha=log_alpha,
            log_variance_bias=log_bias,
            log_variances=logs - log_alpha / log_gamma,
            residual=residual,
            search=search,
        )

    def prototypes(self, rows: int) -> int:
        """Centres of the expansion."""
        return rows

    def bytes(self, rows: int, inputs: int, outputs: int) -> int:
        """Memory of a solution beyond its training rows."""
        return ExactSolution(self.gamma, self.width, 0).bytes(rows, inputs, outputs)

    def _select(
        self, x: Floats, turned: Floats, validation: Rows | None, turn: Floats
    ) -> tuple[KernelEigensystem, list[tuple[float, Floats, Floats]], tuple[float, float, float]]:
        """The eigensystem of the best width, the errors, and the best (width, gamma, coupling)."""
        gammas = GAMMAS if self.gamma is None else (float(self.gamma),)
        couplings = COUPLINGS if self.coupling is None else (float(self.coupling),)
        median = median_distance(x)
        widths = [w * median for w in WIDTHS] if self.width is None else [float(self.width)]
        least, search = np.inf, []
        for width in widths:
            system = KernelEigensystem.of(rbf(x, x, width))
            kernel = None if validation is None else rbf(validation[0], x, width)
            errors = np.empty((len(couplings), len(gammas)))
            for i, coupling in enumerate(couplings):
                for j, gamma in enumerate(gammas):
                    alpha, bias, residual = _solved(system, turned, gamma, coupling)
                    if kernel is not None and validation is not None:
                        residual = kernel @ alpha + bias - validation[1] @ turn
                    errors[i, j] = np.mean(residual**2)
            search.append((width, np.asarray(gammas), errors.min(axis=0)))
            if errors.min() < least:
                least, best = errors.min(), system
                place = divmod(int(np.argmin(errors)), len(gammas))
                chosen = (width, gammas[place[1]], couplings[place[0]])
        return best, sorted(search, key=lambda entry: -float(entry[2].min())), chosen


def _along_and_across(z: Floats) -> Floats:
    """Orthogonal matrix (q, q) whose first column is the signs of the first component over sqrt(q).

    Outputs z (n, q) times it are what they share, and what they differ in.
    """
    q = z.shape[1]
    _, _, axes = np.linalg.svd(z - z.mean(axis=0), full_matrices=False)
    signs = np.where(axes[0] < 0.0, -1.0, 1.0)
    turn, _ = np.linalg.qr(np.column_stack([signs, np.eye(q)[:, : q - 1]]))
    return np.asarray(turn)


def _solved(
    system: KernelEigensystem, turned: Floats, gamma: float, coupling: float
) -> tuple[Floats, Floats, Floats]:
    """Weights (n, q), bias (q,) and leave-one-out residuals (n, q), along and across."""
    q = turned.shape[1]
    along = system.solve(turned[:, :1], gamma * (1.0 + (q - 1.0) * coupling))
    across = system.solve(turned[:, 1:], gamma * (1.0 - coupling))
    alpha, bias, residual = (np.concatenate(p, axis=-1) for p in zip(along, across, strict=True))
    return alpha, bias, residual


class CoupledLSSVM(KernelExpansion):
    """Least squares support vector regression whose outputs have a shared part, for small sets.

    coupling: Share of the variance of each output that the shared part has, 0 to below 1; selected
        if None, by the error on validation rows, or where there are too few by closed-form
        leave-one-out. At 0 it is `LSSVM`.
    gamma, width: As for `LSSVM`.

    Notes
    -----
    It helps where targets are noisy views of one quantity. Targets that depend on the inputs in
    different ways select a coupling of 0. It does not hold beyond 1500 rows, which are refused.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(0.0, 6.0, 40)[:, None]
    >>> both = np.hstack([np.sin(x), -np.sin(x)])
    >>> print(np.round(CoupledLSSVM().fit(x, both).predict([[1.5]]), 2))
    [[ 1. -1.]]
    """

    type_name: ClassVar[str] = "coupled-lssvm"

    def __init__(
        self,
        coupling: float | None = None,
        gamma: float | None = None,
        width: float | None = None,
    ) -> None:
        self.coupling, self.gamma, self.width = coupling, gamma, width

    def solution_for(self, rows: int) -> CoupledSolution:
        """The coupled solution."""
        return CoupledSolution(self.gamma, self.width, self.coupling)

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """None: the coupling is selected anew for each number of rows."""
        return None
