"""Wheels, three families of soil, and the nominal soil that the analyst receives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RADIUS, WIDTH = 0.15, 0.12  # m, of the wheel
#: Radius and width of a second wheel, over those of the first.
SECOND_RADIUS, SECOND_WIDTH = (0.65, 0.95), (0.5, 0.9)

Wheels = tuple[tuple[float, float], ...]  # Radius and width (m) of each wheel

#: Parameters that can be unknown to the analyst: the first three, or all five.
FREE_PARAMETERS = ("cohesion", "friction_angle", "shear_modulus", "kphi", "n")

#: Prior ranges of an unknown soil, SI.
PRIOR = {
    "cohesion": (0.0, 6000.0),
    "friction_angle": (0.25, 0.9),
    "shear_modulus": (0.002, 0.06),
    "kphi": (1e5, 5e6),
    "n": (0.4, 1.6),
}


@dataclass(frozen=True)
class SoilFamily:
    """Ranges of the soil parameters, SI; those with one value are constant within the family."""

    cohesion: tuple[float, float]
    friction_angle: tuple[float, float]
    shear_modulus: tuple[float, float]
    kphi: tuple[float, float]
    n: tuple[float, float]
    kc: float
    unit_weight: float

    def soil(self, generator: np.random.Generator) -> dict[str, float]:
        """One soil of the family, parameter by name, SI."""
        values = {name: float(generator.uniform(*getattr(self, name))) for name in FREE_PARAMETERS}
        return values | {"kc": self.kc, "a0": 0.4, "a1": 0.15, "unit_weight": self.unit_weight}


FAMILIES = {
    "dry-sand": SoilFamily(
        (200.0, 1400.0), (0.47, 0.59), (0.010, 0.025), (1.0e6, 2.0e6), (1.0, 1.15), 990.0, 15000.0
    ),
    "loam": SoilFamily(
        (1000.0, 3000.0), (0.38, 0.52), (0.006, 0.015), (4e5, 9e5), (0.65, 0.8), 5000.0, 14000.0
    ),
    "lunar": SoilFamily(
        (100.0, 600.0), (0.57, 0.72), (0.012, 0.022), (6e5, 1.1e6), (0.95, 1.05), 1400.0, 16000.0
    ),
}


def nominal_soil(
    soil: dict[str, float], free: int, generator: np.random.Generator
) -> dict[str, float]:
    """The soil with errors in its first `free` parameters, clipped to the prior ranges.

    The other parameters are exact, so that the analyst can fix them.
    """
    result = dict(soil)
    for name in FREE_PARAMETERS[:free]:
        spread = 0.05 if name in ("friction_angle", "n") else 0.15
        low, high = PRIOR[name]
        value = soil[name] * (1.0 + spread * generator.uniform(-1.0, 1.0))
        result[name] = float(np.clip(value, low + 0.01 * (high - low), high))
    return result


def draw_wheels(same_size: bool, generator: np.random.Generator) -> Wheels:
    """Two wheels: of the same size, or the second smaller and narrower."""
    radius = round(RADIUS * generator.uniform(*SECOND_RADIUS), 3)
    width = round(WIDTH * generator.uniform(*SECOND_WIDTH), 3)
    first = (RADIUS, WIDTH)
    return (first, first if same_size else (radius, width))
