"""The numbers that Wang, Yan and Du 2018 print on their tracked robot, computed."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from functools import cache, partial
from importlib import resources

import numpy as np

from soilml.physics.soils import soil
from soilml.systems.tracked_robot.robot import BEYOND_PEAK, GROUSERS, WANG2018

LEVEL = np.linspace(0.5, 0.9, 9)  # Slips over which the drawbar pull is averaged as its plateau


@cache
def plateau(ground: str, *, grousers: bool) -> float:
    """Mean drawbar pull (N) of the robot over the slips of the plateau."""
    effects = (*((GROUSERS,) if grousers else ()), *BEYOND_PEAK[ground])
    return float(WANG2018.pull(soil(f"wang2018/{ground}"), LEVEL, effects).mean())


@cache
def printed() -> dict[str, float]:
    """The numbers of the paper's table of numbers, by key."""
    text = resources.files("soilml.papers").joinpath("wang2018.csv").read_text("utf-8")
    return {row["key"]: float(row["published"]) for row in csv.DictReader(text.splitlines())}


def group_mean(name: str) -> float:
    """Mean of one parameter over the eight groups of Table 1, angles in rad."""
    groups = [
        v for key, v in printed().items() if key.startswith("table1_") and key.endswith(f"_{name}")
    ]
    mean = sum(groups) / len(groups)
    return math.radians(mean) if name == "friction_angle" else mean


def implied_points(r2: float, f: float) -> float:
    """Number of points implied by r2 and F of a line: F (1 - r2) / r2 + 2."""
    return f * (1.0 - r2) / r2 + 2.0


def variance_ratio() -> float:
    """F of a line with the printed r2 and the number of points implied by r2 and F."""
    r2 = printed()["regression_r2"]
    points = round(implied_points(r2, printed()["regression_f"]))
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
