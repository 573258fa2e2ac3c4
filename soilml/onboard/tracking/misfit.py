"""The misfit of a set of rows, and how large it must be for rows of different soils."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.onboard.exact_check import NO_ROWS
from soilml.onboard.memory import Memory
from soilml.onboard.set_contract import INFERRED, MODEL_ERROR_INPUT

QUANTILE = 3.72  # Standard normal quantile beyond which a misfit is not chance: 1 in 10 000
#: The same for the last rows together, of which one number is tried after each row: 1 in 1000.
CHANGE_QUANTILE = 3.09
#: Degrees of freedom by which two spans of a drive differ: those of the unknowns, and so many of
#: the errors of sensors, which each span may explain in its own way.
ERROR_DEGREES = 1.0
#: Readings, and rows, with the stated noise that are assumed before the first one.
ASSUMED_READINGS, ASSUMED_ROWS = 8.0, 3
ROWS_JUDGED = 16  # Rows from whose misfit the size of the model error is estimated
#: Most variance of the residuals over that of the stated noise for which a model is still used.
MOST_EXCESS = 10.0
#: The same for noise that an estimate takes from the rows: above it no soil explains them.
MOST_VARIANCE = 3.0
#: Size of the errors of a model that is all but right, whose memories have their columns.
ALL_BUT_RIGHT = 1e-6
Rows = dict[str, NDArray[np.float64]]  # Row inputs of the graph (m,) by name


@dataclass(frozen=True)
class JointFit:
    """The estimate from a set of rows, and the memory with the new rows, not packed."""

    estimate: Estimate
    memory: Memory

    @property
    def misfit(self) -> float:
        """Least sum of squared residuals."""
        return float(self.estimate.misfit)

    @property
    def readings(self) -> float:
        """Readings that take part."""
        return float(self.memory.counts[0])


def judging(estimator: Estimator) -> Estimator:
    """The estimator whose misfit tells rows of another soil: with a model that is all but right.

    Errors of a size that is inferred would explain another soil. Memories are the same.
    """
    inferred = estimator.sets and estimator.sets.common_errors.get(MODEL_ERROR_INPUT) == INFERRED
    return estimator.on(model_error=ALL_BUT_RIGHT) if inferred else estimator


def fit_rows(estimator: Estimator, rows: Rows, memory: Memory) -> JointFit:
    """The fit to the rows of a packed memory and to further ones (m,); m may be 0."""
    return JointFit(*estimator.joint_estimate(rows, memory))


def fit_memory(estimator: Estimator, memory: Memory) -> JointFit:
    """The fit to the rows of a memory."""
    return fit_rows(estimator, estimator.sets.rows(NO_ROWS) if estimator.sets else {}, memory)


def excess_noise(misfit: float, readings: float, unknowns: int) -> float:
    """Variance of the residuals of a fit over that of the stated noise.

    A model that is wrong by some per cent leaves residuals above the noise of the sensors in every
    row. Only what exceeds them is evidence of another soil.
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
