"""Covariance of readings: noise, errors that rows share, a smooth discrepancy; what whitens it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy, range_with_zero
from soilml.config.remainder import Remainder
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.operating_points import gear_numbers
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.numerics.smooth_process import independent_process_columns, slip_load_points
from soilml.quantities import column
from soilml.remarks import Remark

#: Usual model error of a channel in an analysis of gaps, where the case does not state another.
USUAL = Discrepancy(share=0.02)
#: Eigenfunctions with a smaller fraction of the largest eigenvalue are dropped: at ten times the
#: usual amplitude they still change the readings by less than a five-hundredth of their range.
LEAST_EIGENVALUE = 1e-4
#: Largest slip of a row that is moved, and smallest and largest load as multiples of its load.
MOST_SLIP, LEAST_LOAD, MOST_LOAD = 0.999, 1e-3, 2.0


@dataclass(frozen=True)
class Whitening:
    r"""What makes the covariance of m readings one: of noise, and of a process beside it.

    .. math:: W = (I - Q S Q^T) W_0, \quad S = \operatorname{diag}(s)

    `noise` is :math:`W_0`: a matrix (m, m), dense or sparse, the inverse standard deviations (m,)
    of independent noise, or another `Whitening`. Many of these share it, so that each
    takes m q numbers of memory in place of m^2. `whitening @ x` multiplies arrays (m,) and (m, k).
    """

    noise: Any
    basis: Any  # (m, q), dense or sparse, with orthonormal columns
    shrinkage: Floats  # (q,)

    @staticmethod
    def beside(noise: Any, columns: Floats) -> Whitening:
        r"""From what whitens the noise, and columns C (m, q) of the process.

        .. math::
            (I + B B^T)^{-1/2} W_0
            = \left[I - U \left(1 - (1 + s^2)^{-1/2}\right) U^T\right] W_0, \quad
            B = W_0 C = U s V^T

        For residuals r the squared length of the result is r^T (V + C C^T)^{-1} r, with the
        covariance V of the noise.
        """
        white = Whitening(noise, columns[:, :0], np.zeros(0)) @ columns
        if not white.shape[1]:
            return Whitening(noise, white, np.zeros(0))
        basis, size, _ = np.linalg.svd(white, full_matrices=False)
        return Whitening(noise, basis, 1.0 - 1.0 / np.sqrt(1.0 + size**2))

    def __matmul__(self, values: Floats) -> Floats:
        independent = np.ndim(self.noise) == 1
        white = (self.noise * values.T).T if independent else self.noise @ values
        if not self.basis.shape[1]:
            return np.asarray(white)
        shrunk = (self.shrinkage * (self._transposed @ white).T).T
        return np.asarray(white - self.basis @ shrunk)

    @cached_property
    def _transposed(self) -> Any:
        return self.basis.T  # a sparse one takes longer than what it is multiplied with


def squared_residuals_and_log_determinant(
    residual: Floats, std: Floats, columns: Floats
) -> tuple[Floats, Floats]:
    r"""r^T S^-1 r and half of ln det S, (n,) each, for S = diag(std^2) + C C^T.

    .. math::
        r^T S^{-1} r = |D^{-1} r - B w|^2 + |w|^2, \quad w = (I + B^T B)^{-1} B^T D^{-1} r, \quad
        \det S = \det(D)^2 \det(I + B^T B)

    The first form has no cancellation, however small the noise is beside the process.

    residual, std (n, k): Residuals, and standard deviations of the noise; each of the n sets has
        its own.
    columns (k, q) or (n, k, q): C, the columns of the process.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. A.9 and
    A.10 (the lemmas of matrix inversion and of determinants).
    """
    if (std == std[0]).all():  # one factorisation for all sets
        std = std[:1]
    scaled = residual / std
    log_determinant = np.broadcast_to(np.log(std).sum(axis=1), len(residual))
    if columns.shape[-1] == 0:
        return (scaled**2).sum(axis=1), log_determinant
    basis = columns / std[..., None]
    transposed = np.swapaxes(basis, 1, 2)
    inner = transposed @ basis + np.eye(columns.shape[-1])
    weights = np.linalg.solve(inner, transposed @ scaled[..., None])
    left = scaled - (basis @ weights)[..., 0]
    squared = (left**2).sum(axis=1) + (weights[..., 0] ** 2).sum(axis=1)
    return squared, log_determinant + 0.5 * np.linalg.slogdet(inner)[1]


@dataclass(frozen=True)
class DiscrepancyProcess:
    r"""A zero-mean Gaussian process for each channel and gear, in a basis of its eigenfunctions.

    .. math::
        \delta_c(s, W) = \tau_c u_c \sum_k w_k \psi_k(s, \ln W), \quad w_k \sim N(0, 1), \quad
        \sum_k \psi_k \psi_k' = e^{-(s - s')^2 / (2 l_s^2) - (\ln W - \ln W')^2 / (2 l_W^2)}

    References: Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2; Brynjarsdottir
    and O'Hagan, Inverse Problems 30, 2014.
    """

    # (m, q): The functions u_c psi_k at the readings; each is zero outside its channel and gear
    columns: Floats
    channel: Integers  # (q,): Channel of each column
    # (channels,): u_c, the standard deviation of a usual discrepancy in the unit of the channel.
    # Amplitudes tau_c are in this unit; all gears share them.
    usual: Floats


def discrepancy_process(
    readings: Readings,
    declared: Mapping[str, Discrepancy],
    default: Discrepancy = USUAL,
    least_eigenvalue: float = LEAST_EIGENVALUE,
    learned: Remainder | None = None,
) -> DiscrepancyProcess:
    """The process of these readings.

    declared: Model error by column.
    default: That of other columns; a channel whose amplitude is zero has no columns.
    least_eigenvalue: Fraction of the largest eigenvalue below which eigenfunctions are dropped.
    learned: What takes the place of the declared process in the channels that it has: the remainder
        about its mean, where soil and effects are fitted anew.
    """
    gear = gear_numbers(readings.at)
    known: dict[tuple[float, float], Floats] = {}
    columns, channel, usual = [np.zeros((len(readings), 0))], [np.zeros(0, np.int64)], []
    for i, name in enumerate(readings.channels):
        own, in_channel = declared.get(column(name), default), readings.channel == i
        if learned is not None and column(name) in learned.columns:
            columns.append(_learned_columns(learned, readings, i))
            channel.append(np.full(columns[-1].shape[1], i))
            usual.append(1.0)
            continue
        usual.append(own.amplitude(range_with_zero(readings.measured[in_channel])))
        if usual[-1] == 0.0:
            continue
        lengths = own.slip_length, own.log_load_length
        if lengths not in known:
            points = slip_load_points(readings.row_slip, readings.row_load, *lengths)
            known[lengths] = independent_process_columns(
                points, gear, least_eigenvalue=least_eigenvalue
            )
        functions = known[lengths]
        columns.append(usual[-1] * np.where(in_channel[:, None], functions[readings.row], 0.0))
        channel.append(np.full(functions.shape[1], i))
    return DiscrepancyProcess(
        np.concatenate(columns, axis=1), np.concatenate(channel), np.asarray(usual)
    )


def _learned_columns(learned: Remainder, readings: Readings, channel: int) -> Floats:
    """Columns (m, q) of the remainder of a channel; each gear has its own."""
    in_channel, parts = readings.channel == channel, [np.zeros((len(readings), 0))]
    for gear in dict.fromkeys(part.gear for part in learned.parts):
        rows = in_channel & (readings.driven_by("") == gear if gear else True)
        at = readings.slip[rows], readings.load[rows]
        own = learned.process_columns(readings.channels[channel], *at, gear, fitted_anew=True)
        parts.append(np.zeros((len(readings), own.shape[1])))
        parts[-1][rows] = own
    return np.concatenate(parts, axis=1)


def ignored_discrepancy(
    case: Case, what: str, consequence: str = "its intervals are too narrow"
) -> list[Remark]:
    """A remark that `what` ignores [discrepancy]; none for a case without one."""
    declared = (key for key, one in case.discrepancy.items() if one.amplitude(1.0) > 0.0)
    learned = [] if case.remainder is None else case.remainder.columns
    names = [key for key in declared if key not in learned]
    if not names:
        return []
    text = f"{what} ignores the [discrepancy] of {', '.join(names)}: {consequence}"
    return [Remark("discrepancy-ignored", text, tuple(names))]


def noise_of_operation(
    case: Case, readings: Readings, coordinates: Sequence[Coordinate] = (), x: Floats | None = None
) -> Floats:
    r"""Standard deviation (m,) of readings by the declared noise of slip s and load W.

    .. math:: \sigma^2 = \left(\frac{\partial y}{\partial s} \sigma_s\right)^2
        + \left(\frac{\partial y}{\partial W} \sigma_W\right)^2

    First order: the change over one standard deviation, centred, at coordinates x (p,) of the
    case. Rows that have no equilibrium beside them count as exact. That the readings of one row
    share their slip and load is left out, so that the noise of sets of several channels is
    overstated rather than understated.
    """
    slip, load = readings.row_slip, readings.row_load
    x = np.zeros(0) if x is None else x
    total = np.zeros(len(readings))
    for name, values, std, low, high in (  # rows are moved where the model is defined
        ("slip", slip, readings.slip_std, -MOST_SLIP, MOST_SLIP),
        ("load", load, readings.load_std, LEAST_LOAD * load, MOST_LOAD * load),
    ):
        if np.any(std > 0.0):
            there = (np.clip(values + half * std, low, high) for half in (-0.5, 0.5))
            ends = (replace(readings, at=replace(readings.at, **{name: v})) for v in there)
            below, above = (predict(case, coordinates, x[None, :], end)[0] for end in ends)
            total = np.hypot(total, np.nan_to_num(above - below))
    return np.asarray(total)
