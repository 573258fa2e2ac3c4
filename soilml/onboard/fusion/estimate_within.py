"""An estimate of a model file given that the soil lies in a box within its prior."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.features import as_numbers
from soilml.onboard.fusion.narrower_prior import LEAST_MASS, within_box

Floats = NDArray[np.float64]


def estimate_within(estimate: Estimate, box: Mapping[str, tuple[float, float]]) -> Estimate:
    """`Estimate.within`."""
    lower, upper = _box(estimate, box)
    middle, std = 0.5 * (lower + upper), (upper - lower) / math.sqrt(12.0)
    prior = PriorSummary(middle, std, lower, upper)
    shape = np.shape(estimate.in_range)
    given = Estimate.from_prior(estimate.names, estimate.units, prior, shape)
    ends = (estimate.prior.lower, estimate.prior.upper)
    arrays: dict[str, Any] = {k: np.array(getattr(estimate, k)) for k in Estimate.ARRAYS}
    for at in np.ndindex(shape):
        answered = bool(estimate.in_range[at]) or estimate.reason[at] == Reason.INCONSISTENT
        interval = np.stack([estimate.low[at], estimate.high[at]])
        found = None
        if answered:
            found = within_box(
                estimate.mean[at], estimate.covariance[at], interval, ends, (lower, upper)
            )
        if found is None or found.mass < LEAST_MASS:
            for key in ("mean", "std", "covariance", "low", "high"):
                arrays[key][at] = getattr(given, key)[at]
            arrays["in_range"][at] = False
            if found is not None:
                arrays["reason"][at] = int(Reason.INCONSISTENT)
            continue
        for key in ("mean", "std", "covariance", "low", "high"):
            arrays[key][at] = getattr(found, key)
    return replace(estimate, prior=prior, **arrays)


def _box(estimate: Estimate, box: Mapping[str, tuple[float, float]]) -> tuple[Floats, Floats]:
    """Ends (q,) of the box; raises `InputError` where they are not in the prior and in order."""
    lower, upper = estimate.prior.lower.copy(), estimate.prior.upper.copy()
    for name, ends in box.items():
        if name not in estimate.names:
            raise InputError(f"{name!r} is not estimated; there are: {', '.join(estimate.names)}")
        i = estimate.names.index(name)
        given = as_numbers(name, ends)
        if given.shape != (2,):
            raise InputError(f"{name} within {ends!r}; needed are two values, (least, largest)")
        low, high = float(given[0]), float(given[1])
        if not lower[i] <= low < high <= upper[i]:
            raise InputError(
                f"{name} within {low:g} to {high:g} {estimate.units[i]}; needed are two values in "
                f"order within the prior, {lower[i]:g} to {upper[i]:g} {estimate.units[i]}"
            )
        lower[i], upper[i] = low, high
    return lower, upper
