"""Smooth Gaussian processes of slip and load, and functions that draws of them are sums of."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Integers

#: Most points that represent the process. Points closer to each other than the correlation lengths
#: add little: a hundred at slips from -0.5 to 1 and loads within a factor of ten, at the usual
#: lengths, miss less than a fiftieth of the process's standard deviation anywhere.
MOST_CENTRES = 100
#: Eigenvalues below this fraction of the largest are dropped: all together they hold a few
#: thousandths of the process's standard deviation.
LEAST_EIGENVALUE = 1e-6
BLOCK = 1000  # Points whose covariances with all others are computed at once, which bounds memory
SAME_POINT_DECIMALS = 6  # Decimals, in correlation lengths, to which points count as the same


def process_columns(
    points: Floats, amplitude: float | Floats = 1.0, least_eigenvalue: float = LEAST_EIGENVALUE
) -> Floats:
    r"""Columns C (n, q) of a process of zero mean, with C C^T its covariance at n points.

    .. math:: (C C^T)_{ij} = a_i a_j e^{-|x_i - x_j|^2 / 2}

    A sample of the process is C w with q independent standard normal weights w. The covariance is
    exact up to `MOST_CENTRES` distinct points; with more it is Nystroem's approximation, never
    larger than the exact one, which misses part of the process where points lie many correlation
    lengths apart.

    points (n, d): Coordinates over their correlation lengths, such as slip / 0.3 and ln(load) /
        0.6.
    amplitude (n,): Standard deviation a of the process, in the unit of the values.
    least_eigenvalue: Directions with a smaller fraction of the largest eigenvalue are dropped.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 4.9 (the
    covariance) and 8.13 (Nystroem's approximation).

    Examples
    --------
    >>> import numpy as np
    >>> columns = process_columns(np.asarray([[0.0], [1.0]]), 2.0)
    >>> (columns @ columns.T).round(3)
    array([[4.   , 2.426],
           [2.426, 4.   ]])
    """
    if len(points) == 0:
        return np.zeros((0, 0))
    centres = _spread_centres(points)
    eigenvalue, vector = np.linalg.eigh(squared_exponential(centres, centres))
    kept = eigenvalue > least_eigenvalue * eigenvalue[-1]
    basis = vector[:, kept] / np.sqrt(eigenvalue[kept])
    unit = squared_exponential(points, centres) @ basis
    return np.asarray(np.reshape(amplitude, (-1, 1)) * unit)


def independent_process_columns(
    points: Floats,
    group: Integers,
    least_eigenvalue: float = LEAST_EIGENVALUE,
) -> Floats:
    """Columns (n, q) of processes of equal and unit covariance, one for each group of points.

    They are those of `process_columns`; a column is zero at the points of other groups.

    group (n,): Number of the group of each point.
    """
    parts = [np.zeros((len(points), 0))]
    for number in np.unique(group):
        own = process_columns(points[group == number], 1.0, least_eigenvalue)
        parts.append(np.zeros((len(points), own.shape[1])))
        parts[-1][group == number] = own
    return np.concatenate(parts, axis=1)


def slip_load_points(
    slip: Floats, load: Floats, slip_length: float, log_load_length: float
) -> Floats:
    """Slips and log loads (n,), over their correlation lengths: points (n, 2)."""
    return np.column_stack([slip / slip_length, np.log(load) / log_load_length])


def squared_exponential(a: Floats, b: Floats) -> Floats:
    """Correlations (n, m) of points (n, d) with points (m, d)."""
    return np.asarray(np.exp(-0.5 * ((a[:, None, :] - b) ** 2).sum(axis=-1)))


def _spread_centres(points: Floats) -> Floats:
    """At most `MOST_CENTRES` distinct points, each the farthest from those before it."""
    centres = np.unique(points.round(SAME_POINT_DECIMALS), axis=0)
    if len(centres) <= MOST_CENTRES:
        return np.asarray(centres)
    taken = [0]
    distance = np.full(len(centres), np.inf)
    while len(taken) < MOST_CENTRES:
        to_last = ((centres - centres[taken[-1]]) ** 2).sum(axis=1)
        distance = np.minimum(distance, to_last)
        taken.append(int(np.argmax(distance)))
    return np.asarray(centres[taken])


def independent_bound(columns: Floats) -> Floats:
    """Variances (n,) of independent errors that are no smaller than a process with these columns.

    They are the row sums of its covariances without signs: the difference between a diagonal matrix
    of them and the covariance is diagonally dominant, so that it is positive semi-definite. No
    linear combination of the process at the n points has a larger variance than that of the
    independent errors. A point far from all others has its own variance; one of m close together
    has about m times it.

    columns (n, q): Their products are the covariance.

    References: Golub and Van Loan, Matrix Computations, section 4.1.1 (diagonal dominance).
    """
    parts = [np.zeros(0)]
    for i in range(0, len(columns), BLOCK):
        parts.append(np.abs(columns[i : i + BLOCK] @ columns.T).sum(axis=1))
    return np.concatenate(parts)


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
