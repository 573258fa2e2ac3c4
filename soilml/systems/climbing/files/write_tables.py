"""Climbs and stresses as the columns of the two tables that `soilml climb` reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from soilml.systems.climbing.climb import Climb, WheelRun
from soilml.systems.climbing.rover import WHEELS

Columns = dict[str, list[Any]]


def logged(
    climbs: Sequence[Climb],
    front: Sequence[WheelRun] = (),
    rear: Sequence[WheelRun] = (),
    *,
    rim_speed: float | None = None,
) -> tuple[Columns, Columns]:
    """(climbs, stresses): with a rim speed (m/s) the speeds, else the slips.

    `front` and `rear` are stresses at artificial slip, which get runs of their own.
    """
    driven = [(c, w, run) for c in climbs for w, run in zip(WHEELS, c.wheels, strict=True)]
    runs: Columns = {
        "run": [c.name for c, _, _ in driven],
        "wheel": [wheel for _, wheel, _ in driven],
        "slope_rad": [c.slope for c, _, _ in driven],
    }
    if rim_speed is None:
        runs["slip"] = [run.slip for _, _, run in driven]
    else:
        runs["speed_m_s"] = [rim_speed * (1.0 - run.slip) for _, _, run in driven]
        runs["rim_speed_m_s"] = [rim_speed for _ in driven]
    felt = [(c.name, wheel, run) for c, wheel, run in driven]
    for wheel, artificial in zip(WHEELS, (front, rear), strict=True):
        felt += [(f"flat_{wheel}_{i}", wheel, run) for i, run in enumerate(artificial, 1)]
    samples = [
        (name, wheel, run.slip, float(angle), float(normal))
        for name, wheel, run in felt
        for angle, normal in zip(run.profile.angle, run.profile.normal, strict=True)
    ]
    names = ("run", "wheel", "slip", "angle_rad", "normal_Pa")
    return runs, {
        name: list(column) for name, column in zip(names, zip(*samples, strict=True), strict=True)
    }
