"""Priors as they are written in a model file."""

from __future__ import annotations

import math

from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior


def take_prior(settings: Settings, key: str) -> Prior:
    """Read `key = [lower, upper]` or `key = { range = [lower, upper], scale = "log" }`."""
    needed = "[lower, upper], or { range = [lower, upper], scale = 'log' }"
    value = settings.take(key, (list, dict), needed)
    log = False
    if isinstance(value, dict):
        log = value.get("scale") == "log"
        if value.keys() - {"range", "scale"} or value.get("scale", "log") not in ("log", "linear"):
            settings.fail(f"{key} is {value!r}; needed is {needed}")
        value = value.get("range")
    numbers = isinstance(value, list) and all(
        isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in value
    )
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        settings.fail(f"{key} is {value!r}; needed is {needed} with lower below upper")
    lower, upper = float(value[0]), float(value[1])
    if log and lower <= 0.0:
        settings.fail(f"{key}: a logarithmic range must be positive, it begins at {lower:g}")
    return Prior(lower, upper, log)
