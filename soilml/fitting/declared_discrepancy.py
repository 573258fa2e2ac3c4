"""Model discrepancy at measured rows: the columns of its process, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.model_discrepancy import Discrepancy, range_with_zero
from soilml.fitting.observations import Observations
from soilml.fitting.operating_points import gear_numbers
from soilml.numerics.smooth_process import independent_process_columns, slip_load_points
from soilml.quantities import QUANTITIES, column
from soilml.remarks import Remark

Floats = NDArray[np.float64]


def discrepancy_columns(case: Case, data: Observations) -> tuple[Floats, ...]:
    """For each channel, columns (k_c, q_c) of its discrepancy at its k_c readings.

    The product of the columns with their transpose is the covariance. A channel without
    discrepancy has no columns. The errors for several gears are independent.
    """
    gear, parts = gear_numbers(data.at), []
    for channel in data.channels:
        measured = np.isfinite(channel.reading)
        own = case.discrepancy.get(column(channel.name), Discrepancy())
        amplitude = own.amplitude(range_with_zero(channel.reading))
        if amplitude == 0.0:
            parts.append(np.zeros((int(measured.sum()), 0)))
            continue
        points = slip_load_points(
            data.slip[measured], data.load[measured], own.slip_length, own.log_load_length
        )
        parts.append(independent_process_columns(points, gear[measured], amplitude))
    return tuple(parts)


def stacked_columns(parts: Sequence[Floats]) -> Floats:
    """Columns (k, q) for all readings, one channel after another; zero outside their channel."""
    stacked = np.zeros((sum(len(p) for p in parts), sum(p.shape[1] for p in parts)))
    row = first = 0
    for part in parts:
        stacked[row : row + len(part), first : first + part.shape[1]] = part
        row, first = row + len(part), first + part.shape[1]
    return stacked


def included_discrepancy(case: Case, data: Observations) -> list[Remark]:
    """A remark with the standard deviation of each channel's discrepancy; none without one."""
    texts = []
    for channel in data.channels:
        own = case.discrepancy.get(column(channel.name), Discrepancy())
        amplitude = own.amplitude(range_with_zero(channel.reading))
        if amplitude > 0.0:
            texts.append(f"{channel.name} {amplitude:.3g} {QUANTITIES[channel.name].unit}")
    text = f"errors of the model are included in std: {', '.join(texts)}"
    return [Remark("discrepancy-included", text, severity="note")] if texts else []


def ignored_discrepancy(
    case: Case, what: str, consequence: str = "its intervals are too narrow"
) -> list[Remark]:
    """A remark that `what` ignores [discrepancy]; none for a case without one."""
    names = [key for key, one in case.discrepancy.items() if one.amplitude(1.0) > 0.0]
    if not names:
        return []
    text = f"{what} ignores the [discrepancy] of {', '.join(names)}: {consequence}"
    return [Remark("discrepancy-ignored", text, tuple(names))]
