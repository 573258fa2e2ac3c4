"""The kind of a method: which acceptance goals it has, and how it is drawn."""

from __future__ import annotations

import json
from enum import Enum

from soilml.onboard.estimator import Estimator
from training.regressors.linear_gaussian import LinearGaussian


class MethodKind(Enum):
    """What a row of the benchmark is computed by."""

    BAYES_LIMIT = "exact posterior of the same set"
    PRIOR = "prior alone"
    SET_POSTERIOR = "model file, posterior of all rows of a set"
    POOLED = "model file, estimates of single rows pooled although it has a set posterior"
    REGRESSION = "model file without a set posterior, with a nonlinear regressor"
    LINEAR_REGRESSION = "model file without a set posterior, linear regressors alone"
    ANALYTIC = "analytic identification"
    USER_FUNCTION = "function of the caller"


def classify_estimator(estimator: Estimator) -> MethodKind:
    """The kind of a model file, from its metadata; its file name plays no part.

    A file with a set posterior, for one wheel or for any wheel, answers by it. All others are
    distinguished by the regressors of the training spec that the file holds.
    """
    if estimator.sets is not None:
        return MethodKind.SET_POSTERIOR
    regressors = json.loads(estimator.metadata["spec"]).get("regressor", [])
    if all(entry.get("type") == LinearGaussian.kind for entry in regressors):
        return MethodKind.LINEAR_REGRESSION
    return MethodKind.REGRESSION
