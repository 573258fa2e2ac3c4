"""Priors as they are written in a model file."""

from __future__ import annotations

import math

from soilml.config.units import in_si
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior

#: Priors about zero by the name that they have in a model file.
NORMAL = {"normal": Prior.normal, "half-normal": Prior.half_normal}


def take_prior(settings: Settings, key: str, *, unit: str = "1", about_zero: bool = False) -> Prior:
    """Read `key = [lower, upper]` or `key = { range = [lower, upper], scale = "log" }`.

    With `about_zero`, also a normal prior about zero, `{ normal = 0.2 }`, or its positive half,
    `{ half-normal = 0.2 }`. Numbers are in the SI unit `unit`, or texts with a unit: "25 deg".
    """
    needed = "[lower, upper], or { range = [lower, upper], scale = 'log' }"
    if about_zero:
        needed += ", or { normal = std }, or { half-normal = std }"
    value = settings.take(key, (list, dict), needed)
    kind = next(iter(value)) if isinstance(value, dict) and len(value) == 1 else None
    if about_zero and kind in NORMAL:
        std = (
            in_si(settings, key, value[kind], unit) if isinstance(value[kind], str) else value[kind]
        )
        if isinstance(std, bool) or not isinstance(std, int | float) or not 0.0 < std < math.inf:
            settings.fail(f"{key}: {kind} is {std!r}; needed is a standard deviation above zero")
        return NORMAL[kind](float(std))
    log = False
    if isinstance(value, dict):
        log = value.get("scale") == "log"
        if value.keys() - {"range", "scale"} or value.get("scale", "log") not in ("log", "linear"):
            settings.fail(f"{key} is {value!r}; needed is {needed}")
        value = value.get("range")
    if isinstance(value, list):
        value = [in_si(settings, key, x, unit) if isinstance(x, str) else x for x in value]
    numbers = isinstance(value, list) and all(
        isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in value
    )
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        settings.fail(f"{key} is {value!r}; needed is {needed} with lower below upper")
    lower, upper = float(value[0]), float(value[1])
    if log and lower <= 0.0:
        settings.fail(f"{key}: a logarithmic range must be positive, it begins at {lower:g}")
    return Prior(lower, upper, log)
