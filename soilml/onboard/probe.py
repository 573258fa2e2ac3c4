"""Whether a model file gives the answers that are stored in it, on this machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator

#: Largest deviation of mean or std from the file's own probe, in prior standard deviations.
PROBE_TOLERANCE = 1e-4
#: The same for sets: a rounding difference can change which samples are drawn.
SET_PROBE_TOLERANCE = 0.05


def reproduces(
    estimator: Estimator, readings: Any, mean: Any, std: Any, in_range: Any, given: Any = None
) -> bool:
    """Whether the answers to readings agree with those stored in the file.

    With context inputs `given`, which may be none, the readings are a set.
    """
    if given is None:
        answer, tolerance = estimator(**readings), PROBE_TOLERANCE
    else:
        configured = estimator.on(**given) if given else estimator
        answer, tolerance = configured.run(**readings), SET_PROBE_TOLERANCE
    deviations = np.abs(answer.mean - np.asarray(mean)), np.abs(answer.std - np.asarray(std))
    agree = all(bool(np.all(part < tolerance * answer.prior_std)) for part in deviations)
    return np.array_equal(answer.in_range, in_range) and agree
