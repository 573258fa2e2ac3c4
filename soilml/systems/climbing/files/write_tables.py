"""Climbs and stresses as the columns of the two tables that `soilml climb` reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from soilml.systems.climbing.climb import WHEELS, Climb, WheelRun

Columns = dict[str, list[Any]]


def climb_tables(
    climbs: Sequence[Climb],
    front: Sequence[WheelRun] = (),
    rear: Sequence[WheelRun] = (),
    *,
    rim_speed: float | None = None,
) -> tuple[Columns, Columns]:
    """Tables (climbs, stresses) of columns; with a rim speed (m/s) the speeds, else the slips.

    `front` and `rear` are stresses at artificial slip, which become separate runs.
    """
    climbed = [(c, w, run) for c in climbs for w, run in zip(WHEELS, c.wheels, strict=True)]
    runs: Columns = {
        "run": [c.name for c, _, _ in climbed],
        "wheel": [wheel for _, wheel, _ in climbed],
        "slope_rad": [c.slope for c, _, _ in climbed],
    }
    if rim_speed is None:
        runs["slip"] = [run.slip for _, _, run in climbed]
    else:
        runs["speed_m_s"] = [rim_speed * (1.0 - run.slip) for _, _, run in climbed]
        runs["rim_speed_m_s"] = [rim_speed for _ in climbed]
    stressed = [(c.name, wheel, run) for c, wheel, run in climbed]
    for wheel, artificial in zip(WHEELS, (front, rear), strict=True):
        stressed += [(f"flat_{wheel}_{i}", wheel, run) for i, run in enumerate(artificial, 1)]
    samples = [
        (name, wheel, run.slip, float(angle), float(normal))
        for name, wheel, run in stressed
        for angle, normal in zip(run.profile.angle, run.profile.normal, strict=True)
    ]
    names = ("run", "wheel", "slip", "angle_rad", "normal_Pa")
    return runs, {
        name: list(column) for name, column in zip(names, zip(*samples, strict=True), strict=True)
    }
