"""How large a misfit must be before rows are taken for those of different soils."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.numerics.chi_squared import chi_squared_quantile

#: Standard normal quantile beyond which a misfit is not chance: 1 in 10 000.
QUANTILE = 3.72
#: Degrees of freedom by which two spans of a drive differ: those of the unknowns, and so many of
#: the errors of sensors, which each span may explain in its own way.
ERROR_DEGREES = 1.0
#: Readings, and rows, with the stated noise that are assumed before the first one.
ASSUMED_READINGS, ASSUMED_ROWS = 8.0, 3
#: Rows whose misfit tells how far the model is usually off.
ROWS_JUDGED = 16
#: Most variance of the residuals over that of the stated noise for which a model is still used.
MOST_EXCESS = 10.0


def chi_squared_limit(degrees: float) -> float:
    """The value that a chi-squared variable exceeds as rarely as a normal one its `QUANTILE`."""
    return chi_squared_quantile(degrees, QUANTILE)


def excess_noise(misfit: float, readings: float, unknowns: int) -> float:
    """Variance of the residuals of a fit over that of the stated noise.

    A model that is wrong by some per cent leaves residuals above the noise of the sensors in every
    row. Only what exceeds them tells that a row is of another soil.
    """
    freedom = max(readings - unknowns, 0.0) + ASSUMED_READINGS
    return (misfit + ASSUMED_READINGS) / freedom


def usual_excess(increases: Sequence[float]) -> float:
    """The same from what each of the last rows added to the misfit, over its median, 1 or more.

    Rows that were set aside count too, or else a model that is wrong from the first row on would
    have none of them used; a few glitches do not change the median.
    """
    assumed = [1.0] * ASSUMED_ROWS
    return float(np.clip(np.median([*assumed, *increases]), 1.0, MOST_EXCESS))


def over_median(misfit: float, readings: float) -> float:
    """What a row adds to the misfit over the median of chi-squared with its readings."""
    return misfit / chi_squared_quantile(readings, 0.0)
