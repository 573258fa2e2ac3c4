"""Hypotheses that were fitted, and fits to be made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import Linearisation
from soilml.inference import constants
from soilml.inference.evidence import Evidence, LinearisedFit
from soilml.inference.gaussian_terms import Hyperparameters
from soilml.inference.problem import Hypothesis

Booleans = NDArray[np.bool_]


@dataclass(eq=False)
class Explanation:
    """A hypothesis that was fitted.

    value: -2 ln of its posterior probability, up to a constant that all share.
    beside, without: Evidence with a discrepancy, and without one.
    outliers (m,): Readings that stray by this hypothesis.
    """

    hypothesis: Hypothesis
    fit: Solution
    linear: LinearisedFit
    beside: Evidence
    without: Evidence
    value: float
    outliers: Booleans
    extended: bool = False

    @property
    def best(self) -> Evidence:
        """The evidence of the likelier of both."""
        return min(self.beside, self.without, key=lambda own: own.trusted)

    @property
    def promising(self) -> Evidence:
        """That of the likelier one if steps are as good as they promise: where to fit next."""
        return min(self.beside, self.without, key=lambda own: own.value)

    @property
    def hoped(self) -> float:
        """The value if the step to the optimum gives what it promises."""
        return self.value - self.best.trusted + min(self.best.trusted, self.promising.value)

    @property
    def share_without(self) -> float:
        """Probability that there is no discrepancy, given the hypothesis."""
        prior = constants.DISCREPANCY_PRIOR
        logs = np.log([1.0 - prior, prior])
        logs = logs - 0.5 * np.asarray([self.without.trusted, self.beside.trusted])
        return float(np.exp(logs[0] - np.logaddexp(*logs)))

    @property
    def at(self) -> Hyperparameters:
        """The hyperparameters of the likelier of both."""
        return self.best.at


@dataclass(frozen=True, eq=False)
class StartedFit:
    """A fit to be made: hypothesis, coordinates to start from by path, and hyperparameters.

    near: A linearisation near the start. value: What is predicted of the hypothesis.
    """

    hypothesis: Hypothesis
    start: Mapping[str, float]
    at: Hyperparameters
    outliers: Booleans
    near: Linearisation | None = None
    value: float = np.inf
