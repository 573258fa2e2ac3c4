"""Measurement noise: absolute, relative, or both."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.io.toml_settings import Settings


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a sensor, from an absolute and a relative part in quadrature.

    Attributes
    ----------
    constant
        Absolute part, in the unit of the column.
    share
        Relative part, as a fraction of the reading.
    """

    constant: float = 0.0
    share: float = 0.0

    def std(self, reading: Any) -> Any:
        """Standard deviation (...) at readings (...), in their unit."""
        return np.hypot(self.constant, self.share * np.abs(reading))

    def as_setting(self) -> Any:
        """As it is written in TOML."""
        share = f"{100 * self.share:.15g} %"
        if self.share and self.constant:
            return f"{share} + {self.constant!r}"
        return share if self.share else self.constant


_SHARE = re.compile(r"\s*([0-9.eE+-]+)\s*%\s*(?:\+\s*([0-9.eE+-]+)\s*)?")


def take_noise(settings: Settings, key: str) -> Noise:
    """Read `key = 0.05`, `key = "2 %"` or `key = "2 % + 0.05"`."""
    needed = "a number in the column's unit, '2 %' of the reading, or '2 % + 0.05'"
    value = settings.take(key, (int, float, str), needed)
    noise = Noise()
    try:
        if not isinstance(value, str):
            noise = Noise(constant=float(value))
        elif match := _SHARE.fullmatch(value):
            noise = Noise(constant=float(match[2] or 0.0), share=float(match[1]) / 100.0)
        else:
            settings.fail(f"{key} is {value!r}; needed is {needed}")
    except ValueError:
        settings.fail(f"{key} is {value!r}; needed is {needed}")
    size = noise.constant + noise.share
    if not (math.isfinite(size) and noise.constant >= 0 and noise.share >= 0 and size > 0):
        settings.fail(f"{key} is {value!r}; a standard deviation must be above zero")
    return noise
