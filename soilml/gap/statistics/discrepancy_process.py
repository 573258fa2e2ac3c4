"""Smooth discrepancy between model and measurement: a Gaussian process of slip and log load."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.gap.data.stacked_readings import StackedReadings

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Correlation lengths of the discrepancy in slip and in the logarithm of the load.
SLIP_LENGTH, LOG_LOAD_LENGTH = 0.3, 0.6
#: Usual model error as a fraction of a channel's range, where the case does not state another.
USUAL_FRACTION = 0.02
#: Points that represent the process: beyond some tens, points closer than the correlation lengths
#: add nothing.
MOST_POINTS = 60
#: Eigenfunctions with a smaller fraction of the largest eigenvalue are dropped: at ten times the
#: usual amplitude they still change the readings by less than a thousandth of their range.
MIN_EIGENVALUE = 1e-4


@dataclass(frozen=True)
class DiscrepancyProcess:
    r"""A zero-mean Gaussian process for each channel, in a basis of its eigenfunctions.

    .. math::
        \delta_c(s, W) = \tau_c u_c \sum_k w_k \psi_k(s, \ln W), \quad w_k \sim N(0, 1), \quad
        \sum_k \psi_k \psi_k' = e^{-(s - s')^2 / (2 l_s^2) - (\ln W - \ln W')^2 / (2 l_W^2)}

    Attributes
    ----------
    columns : array (m, q)
        The functions u_c psi_k at the readings; each is zero outside its channel.
    channel : array (q,)
        Channel of each column.
    usual : array (channels,)
        u_c, the standard deviation of a usual discrepancy in the unit of the channel. Amplitudes
        tau_c are in this unit.

    References
    ----------
    Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 2001, eq. 5; Brynjarsdottir and O'Hagan, Inverse
    Problems 30, 2014.
    """

    columns: Floats
    channel: Integers
    usual: Floats

    @cached_property
    def variance(self) -> Floats:
        """Variance of each reading at unit amplitude, (m,)."""
        return np.asarray((self.columns**2).sum(axis=1))


def discrepancy_process(
    readings: StackedReadings, fraction: dict[str, float] | None = None
) -> DiscrepancyProcess:
    """The process of these readings.

    Parameters
    ----------
    fraction : dict, optional
        Usual model error by channel, as a fraction of the channel's range, which includes zero.
    """
    points = np.column_stack(
        [
            np.asarray(readings.at.slip, dtype=np.float64) / SLIP_LENGTH,
            np.log(np.asarray(readings.at.load, dtype=np.float64)) / LOG_LOAD_LENGTH,
        ]
    )
    functions = _eigenfunctions(points)
    columns, channel, usual = [], [], []
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        values = readings.reading[in_channel]
        span = max(float(values.max(initial=0.0)), 0.0) - min(float(values.min(initial=0.0)), 0.0)
        usual.append((fraction or {}).get(name, USUAL_FRACTION) * max(span, 1e-300))
        own = np.where(in_channel[:, None], functions[readings.row], 0.0)
        columns.append(usual[-1] * own)
        channel.append(np.full(functions.shape[1], i))
    return DiscrepancyProcess(
        np.concatenate(columns, axis=1) if columns else np.zeros((len(readings), 0)),
        np.concatenate(channel) if channel else np.zeros(0, dtype=np.int64),
        np.asarray(usual),
    )


def _eigenfunctions(points: Floats) -> Floats:
    """Functions (n, r) whose products sum to the squared-exponential kernel of points (n, 2).

    The kernel is represented by at most `MOST_POINTS` of the points (Nystroem's approximation;
    Williams and Seeger, NIPS 13, 2001).
    """
    chosen = _spread(points)
    square = ((chosen[:, None, :] - chosen) ** 2).sum(axis=-1)
    value, vector = np.linalg.eigh(np.exp(-0.5 * square))
    kept = value > MIN_EIGENVALUE * value[-1]
    cross = np.exp(-0.5 * ((points[:, None, :] - chosen) ** 2).sum(axis=-1))
    return np.asarray(cross @ (vector[:, kept] / np.sqrt(value[kept])))


def _spread(points: Floats) -> Floats:
    """At most `MOST_POINTS` distinct points, each the farthest from those chosen before."""
    distinct = np.unique(np.round(points, 6), axis=0)
    if len(distinct) <= MOST_POINTS:
        return np.asarray(distinct)
    chosen = [0]
    distance = ((distinct - distinct[0]) ** 2).sum(axis=1)
    while len(chosen) < MOST_POINTS:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((distinct - distinct[chosen[-1]]) ** 2).sum(axis=1))
    return np.asarray(distinct[chosen])
