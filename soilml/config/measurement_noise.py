"""Measurement noise: absolute, relative, or both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.config.share_and_constant import (
    share_and_constant_as_setting,
    take_share_and_constant,
)
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
        relative = self.share * np.abs(reading)
        if self.constant == 0.0:
            return relative
        return np.sqrt(self.constant**2 + relative**2)  # in half the time of hypot

    def as_setting(self) -> Any:
        """As it is written in TOML."""
        return share_and_constant_as_setting(self.share, self.constant)


def take_noise(settings: Settings, key: str) -> Noise:
    """Read `key = 0.05`, `key = "2 %"` or `key = "2 % + 0.05"`."""
    needed = "a number in the column's unit, '2 %' of the reading, or '2 % + 0.05'"
    share, constant = take_share_and_constant(settings, key, needed)
    if share + constant == 0.0:
        settings.fail(
            f"{key} is {settings.content[key]!r}; a standard deviation must be above zero"
        )
    return Noise(constant=constant, share=share)
