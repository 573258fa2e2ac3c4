"""The soil that explains a set of rows best: one call of the graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.onboard.memory import Memory
from soilml.onboard.set_estimate import estimate_of_set

#: Row inputs of the graph (m,) by name.
Rows = dict[str, NDArray[np.float64]]


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


def fit_rows(estimator: Estimator, rows: Rows, memory: Memory) -> JointFit:
    """The fit to the rows of a packed memory and to further ones (m,); m may be 0."""
    if estimator.sets is None:
        raise InputError(f"{estimator.path} has no set posterior; train it with [set_posterior]")
    found, after = estimator.sets.update(estimator.session, rows, memory)
    names, units, prior = estimator.names, estimator.units, estimator.prior
    return JointFit(estimate_of_set(names, units, prior, found, after), after)


def fit_memory(estimator: Estimator, memory: Memory) -> JointFit:
    """The fit to the rows of a memory."""
    nothing: dict[str, list[float]] = {"slip": [], "torque": [], "load": []}
    return fit_rows(estimator, estimator.sets.rows(nothing) if estimator.sets else {}, memory)
