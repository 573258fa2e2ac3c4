"""Smooth discrepancy between model and measurement: a Gaussian process of slip and log load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.model_discrepancy import Discrepancy, range_with_zero
from soilml.fitting.operating_points import gear_numbers
from soilml.fitting.readings import Readings
from soilml.numerics.smooth_process import independent_process_columns, slip_load_points
from soilml.quantities import column

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Usual model error of a channel, where the case does not state another.
USUAL = Discrepancy(share=0.02)
#: Eigenfunctions with a smaller fraction of the largest eigenvalue are dropped: at ten times the
#: usual amplitude they still change the readings by less than a five-hundredth of their range.
LEAST_EIGENVALUE = 1e-4


@dataclass(frozen=True)
class DiscrepancyProcess:
    r"""A zero-mean Gaussian process for each channel and gear, in a basis of its eigenfunctions.

    .. math::
        \delta_c(s, W) = \tau_c u_c \sum_k w_k \psi_k(s, \ln W), \quad w_k \sim N(0, 1), \quad
        \sum_k \psi_k \psi_k' = e^{-(s - s')^2 / (2 l_s^2) - (\ln W - \ln W')^2 / (2 l_W^2)}

    Attributes
    ----------
    columns : array (m, q)
        The functions u_c psi_k at the readings; each is zero outside its channel and gear.
    channel : array (q,)
        Channel of each column.
    usual : array (channels,)
        u_c, the standard deviation of a usual discrepancy in the unit of the channel. Amplitudes
        tau_c are in this unit; all gears share them.

    References
    ----------
    Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2;
    Brynjarsdottir and O'Hagan, Inverse Problems 30, 2014.
    """

    columns: Floats
    channel: Integers
    usual: Floats


def discrepancy_process(
    readings: Readings, declared: Mapping[str, Discrepancy] | None = None
) -> DiscrepancyProcess:
    """The process of these readings.

    Parameters
    ----------
    declared : mapping, optional
        Usual model error by column, where it differs from `USUAL`.
    """
    declared = declared or {}
    lengths = next(iter(declared.values()), USUAL)
    slip = np.asarray(readings.at.slip, dtype=np.float64)
    load = np.asarray(readings.at.load, dtype=np.float64)
    points = slip_load_points(slip, load, lengths.slip_length, lengths.log_load_length)
    functions = independent_process_columns(
        points, gear_numbers(readings.at), least_eigenvalue=LEAST_EIGENVALUE
    )
    columns, channel, usual = [], [], []
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        span = range_with_zero(readings.reading[in_channel])
        usual.append(declared.get(column(name), USUAL).amplitude(span))
        own = np.where(in_channel[:, None], functions[readings.row], 0.0)
        columns.append(usual[-1] * own)
        channel.append(np.full(functions.shape[1], i))
    return DiscrepancyProcess(
        np.concatenate(columns, axis=1) if columns else np.zeros((len(readings), 0)),
        np.concatenate(channel) if channel else np.zeros(0, dtype=np.int64),
        np.asarray(usual),
    )
