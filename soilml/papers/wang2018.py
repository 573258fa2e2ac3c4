"""The numbers that Wang, Yan and Du 2018 print on their tracked robot, computed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from soilml.papers.published import printed
from soilml.physics.soils import soil
from soilml.systems.tracked_robot.robot import BEYOND_PEAK, GROUSERS, WANG2018

LEVEL = np.linspace(0.5, 0.9, 9)  # Slips over which the drawbar pull is averaged as its plateau


@cache
def plateau(ground: str, *, grousers: bool) -> float:
    """Mean drawbar pull (N) of the robot over the slips of the plateau."""
    effects = (*((GROUSERS,) if grousers else ()), *BEYOND_PEAK[ground])
    return float(WANG2018.pull(soil(f"wang2018/{ground}"), LEVEL, effects).mean())


def group_mean(name: str) -> float:
    """Mean of one parameter over the eight groups of Table 1, angles in rad."""
    groups = [
        v
        for key, v in printed("wang2018").items()
        if key.startswith("table1_") and key.endswith(f"_{name}")
    ]
    mean = sum(groups) / len(groups)
    return math.radians(mean) if name == "friction_angle" else mean


def implied_points(r2: float, f: float) -> float:
    """Number of points implied by r2 and F of a line: F (1 - r2) / r2 + 2."""
    return f * (1.0 - r2) / r2 + 2.0


def variance_ratio() -> float:
    """F of a line with the printed r2 and the number of points implied by r2 and F."""
    book = printed("wang2018")
    r2 = book["regression_r2"]
    points = round(implied_points(r2, book["regression_f"]))
    return r2 / (1.0 - r2) * (points - 2)


def gain(ground: str) -> float:
    """Increase of the plateau by grousers, N."""
    return plateau(ground, grousers=True) - plateau(ground, grousers=False)


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    **{
        f"sand_{name}": partial(group_mean, name)
        for name in ("n", "friction_angle", "kp", "shear_modulus", "cohesion")
    },
    "regression_f": variance_ratio,
    **{f"{g}_bare": partial(plateau, g, grousers=False) for g in ("sand", "clay")},
    **{f"{g}_grousers": partial(plateau, g, grousers=True) for g in ("sand", "clay")},
    **{f"{g}_gain": partial(gain, g) for g in ("sand", "clay")},
}
