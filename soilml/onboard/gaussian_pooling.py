"""The estimates of single readings joined, where a model file has no set posterior."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import Estimate, pooled_within_prior

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator

Floats = NDArray[np.float64]

#: A run of which less than this share is in range is not estimated.
LEAST_SOUND = 0.9


def pooled_run(estimator: Estimator, measured: Mapping[str, Floats]) -> Estimate:
    """One estimate of an `Estimator` from readings (rows,) of one soil, each estimated by itself.

    Rows of nearly the same slip and load count as one. Where too many are out of range, or they
    contradict each other as rows of one soil hardly ever do, the answer is the prior.
    """
    single, together = estimator(**measured), estimator.together
    sound = single.in_range
    if sound.size == 1:
        parts = (single.mean[0], single.covariance[0], single.std[0], sound[0])
        return estimator.estimate(*parts, together.alone)
    if sound.sum() < LEAST_SOUND * sound.size:
        return estimator.unknown()
    rule = together.rule({name: values[sound] for name, values in measured.items()})
    joint = pooled_within_prior(single.mean[sound], single.covariance[sound], estimator.prior, rule)
    if bool((joint.doubt > together.doubt).any()):
        return estimator.unknown()
    std = np.sqrt(np.diag(joint.covariance))
    return estimator.estimate(joint.mean, joint.covariance, std, np.asarray(True), rule.reach)
