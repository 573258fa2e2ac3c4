"""A smooth process of slip and load as a sum of few functions with independent normal weights."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.smooth_process import slip_load_points, squared_exponential

Factor = Callable[[Floats, Floats], Floats]
#: Distance of the nodes, in correlation lengths. Of a process with a squared exponential
#: covariance, 3e-5 of the power has a shorter wave length than two of these distances.
SPACING = 0.75
#: Share of the process's variance at the nodes that the functions may leave out.
LEFT_OUT = 1e-3


@dataclass(frozen=True)
class _Interpolated:
    """Functions that interpolate between nodes (k, 2), times a factor of slip and load.

    coefficients (k, q): In the unit of the process, or without one where the factor has it.
    """

    lengths: tuple[float, float]
    nodes: Floats
    coefficients: Floats
    factor: Factor | None = None

    def at(self, slip: Floats, load: Floats) -> Floats:
        points = slip_load_points(slip, load, *self.lengths)
        values = squared_exponential(points, self.nodes) @ self.coefficients
        return values if self.factor is None else self.factor(slip, load)[:, None] * values


@dataclass(frozen=True)
class SmoothFunctions:
    r"""Functions whose weighted sum is a draw of a process, at any slip and load of a range.

    .. math:: \delta(x) = \sum_j w_j \phi_j(x), \quad
        \phi_j(x) = \sum_k B_{kj} e^{-|x - x_k|^2 / 2}, \quad w_j \sim N(0, 1)

    with slip and the logarithm of the load over their correlation lengths in x. B interpolates the
    process's principal components between nodes x_k of a regular grid. A draw does not depend on
    the rows at which it is asked for, as one from their covariance matrix does. Outside the range
    the functions fade.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 2.25 (the
    interpolation), section 4.3 (principal components of a process).
    """

    parts: tuple[_Interpolated, ...]

    @staticmethod
    def of(
        columns: Factor,
        lengths: tuple[float, float],
        slip: tuple[float, float],
        load: tuple[float, float],
    ) -> SmoothFunctions:
        """From columns (k, p) of the process at slips and loads (k,).

        lengths: Correlation lengths in slip and in the natural logarithm of load.
        slip, load: Smallest and largest slip, and load (N), of the range.
        """
        ends = slip_load_points(np.asarray(slip), np.asarray(load), *lengths).T
        axes = [low + SPACING * np.arange(-1, _steps(high - low) + 2) for low, high in ends]
        nodes = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)
        at_nodes = columns(nodes[:, 0] * lengths[0], np.exp(nodes[:, 1] * lengths[1]))
        vector, size, _ = np.linalg.svd(at_nodes, full_matrices=False)
        left = 1.0 - np.cumsum(size**2) / max(float(np.sum(size**2)), 1e-300)
        kept = min(int(np.sum(left > LEFT_OUT)) + 1, int(np.sum(size > 0.0)))
        between = np.linalg.solve(squared_exponential(nodes, nodes), vector[:, :kept] * size[:kept])
        return SmoothFunctions((_Interpolated(lengths, nodes, between),))

    @staticmethod
    def joined(parts: Iterable[SmoothFunctions]) -> SmoothFunctions:
        """The functions of processes that are independent of each other, and add up."""
        return SmoothFunctions(tuple(own for part in parts for own in part.parts))

    def times(self, factor: Factor) -> SmoothFunctions:
        """The functions of `of` times a factor (n,) of slips and loads (n,)."""
        return SmoothFunctions(tuple(replace(part, factor=factor) for part in self.parts))

    @property
    def count(self) -> int:
        """Number of functions, q."""
        return sum(part.coefficients.shape[1] for part in self.parts)

    def at(self, slip: Floats, load: Floats) -> Floats:
        """The functions (n, q) at slips and loads (n,)."""
        return np.concatenate([part.at(slip, load) for part in self.parts], axis=1)


def _steps(width: float) -> int:
    return int(np.ceil(width / SPACING))
