"""The outputs of a graph for a set of rows as an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.gaussian_pooling import LEAST_SHARE_IN_RANGE
from soilml.onboard.memory import Memory


def estimate_of_set(
    names: tuple[str, ...],
    units: tuple[str, ...],
    prior: PriorSummary,
    outputs: Sequence[Any],
    memory: Memory,
) -> Estimate:
    """The estimate with its reason.

    Parameters
    ----------
    names, units, prior
        As in `Estimate`.
    outputs : sequence
        Outputs of the graph in the order of `SET_OUTPUTS`.
    memory : Memory
        The memory with these rows.
    """
    mean, std, covariance, low, high = (x.astype(np.float64) for x in outputs[:5])
    in_range, (_, rows, rows_used) = bool(outputs[5][0]), memory.counts.tolist()
    return Estimate(
        names=names,
        units=units,
        mean=mean,
        std=std,
        covariance=covariance,
        low=low,
        high=high,
        in_range=np.asarray(in_range),
        prior=prior,
        misfit=np.asarray(float(outputs[6][0])),
        rows_used=np.asarray(int(rows_used)),
        rows_set_aside=np.asarray(int(rows - rows_used)),
        reason=np.asarray(int(_reason(in_range, memory))),
    )


def _reason(in_range: bool, memory: Memory) -> Reason:
    """Why a set has the estimate that it has, as its graph decides."""
    if in_range:
        return Reason.ESTIMATED
    readings, rows, rows_in_range = memory.counts
    if not rows_in_range >= rows * np.float32(LEAST_SHARE_IN_RANGE):
        return Reason.OUT_OF_RANGE
    return Reason.INCONSISTENT if readings > 0.5 else Reason.NO_INFORMATION
