"""The tables of climbs and of rim stresses, read and written, and combined wheel by wheel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError, TableError
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.systems.climbing.climb import WHEELS, Climb, WheelRun
from soilml.systems.force_sensor_wheel import StressProfile

#: Required columns; in addition slip, or speed_m_s and rim_speed_m_s.
CLIMB_COLUMNS = ("run", "wheel", "slope_rad")
STRESS_COLUMNS = ("run", "wheel", "angle_rad", "normal_Pa")
SLIP_TOLERANCE = 1e-3  # Largest difference between the slips of a run in both tables

Key = tuple[str, str]


@dataclass(frozen=True)
class ClimbData:
    """Climbs, and all stresses measured at a known slip, on climbs or on level ground."""

    climbs: tuple[Climb, ...]
    front: tuple[WheelRun, ...]
    rear: tuple[WheelRun, ...]


def read_climb_data(
    runs: str, stress_path: str, noise: Noise, *, ignore_extra: bool = False
) -> ClimbData:
    """Read a table of climbs and one of stresses; raises `TableError` naming file and row.

    A climb has one row for its front and one for its rear wheel, and stresses of both. Stresses of
    other runs, such as artificial slip on level ground, need a slip of their own. `noise` is that
    of the stress where the table has no normal_Pa_std.
    """
    filled = (*CLIMB_COLUMNS, "slip", "speed_m_s", "rim_speed_m_s")
    climbed = read_table(runs, CLIMB_COLUMNS, filled=filled, ignore_extra=ignore_extra)
    stresses = read_table(
        stress_path, STRESS_COLUMNS, filled=STRESS_COLUMNS, ignore_extra=ignore_extra
    )
    for table, known in ((climbed, ()), (stresses, ("normal_Pa_std",))):
        for name in table.columns:
            if name.endswith("_std") and name not in known:
                raise TableError(f"{table.source}: column {name} is not read; set it in [noise]")
        _check_wheels(table)
    slips = _slips(climbed)
    wheels = _wheel_runs(stresses, slips, noise, str(runs))
    return ClimbData(
        climbs=tuple(
            Climb(name, _slope(rows, name), *(_wheel(wheels, name, w, stresses) for w in WHEELS))
            for name, rows in climbed.groups()
            if _has_both(rows, name)
        ),
        front=tuple(run for (_, wheel), run in wheels.items() if wheel == "front"),
        rear=tuple(run for (_, wheel), run in wheels.items() if wheel == "rear"),
    )


def _check_wheels(table: Table) -> None:
    odd = ~np.isin(table["wheel"], WHEELS)
    if odd.any():
        row = int(np.argmax(odd))
        raise TableError(
            f"{table.place(row)}, column wheel: {str(table['wheel'][row])!r} given; needed is "
            "front or rear"
        )


def _slips(climbed: Table) -> dict[Key, float]:
    """The slip of each wheel of each climb."""
    if "slip" in climbed:
        slip, from_column = climbed["slip"], "slip"
    elif "speed_m_s" in climbed and "rim_speed_m_s" in climbed:
        slip, from_column = _slip_of_speeds(climbed), "speed_m_s"
    else:
        raise TableError(
            f"{climbed.source}: column slip is missing; needed is slip, or speed_m_s and "
            "rim_speed_m_s of each wheel"
        )
    slips: dict[Key, float] = {}
    for row, key in enumerate(zip(climbed["run"], climbed["wheel"], strict=True)):
        if key in slips:
            raise TableError(
                f"{climbed.place(row)}: run {key[0]} has a second row for its {key[1]} wheel; "
                "give each repetition a name of its own"
            )
        if not abs(slip[row]) < 1.0:
            raise TableError(
                f"{climbed.place(row)}, column {from_column}: gives slip {slip[row]:.3g}; needed "
                "is a slip between -1 and 1"
            )
        slips[key] = float(slip[row])
    return slips


def _slip_of_speeds(climbed: Table) -> Floats:
    """Slip (rows,): driving 1 - v / (r omega), braking r omega / v - 1; 1 where neither turns."""
    speed, rim = climbed["speed_m_s"], climbed["rim_speed_m_s"]
    largest = np.maximum(speed, rim)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(largest > 0.0, (rim - speed) / largest, np.nan)


def _wheel_runs(
    stresses: Table, slips: dict[Key, float], noise: Noise, runs: str
) -> dict[Key, WheelRun]:
    """The stress of each wheel in each run, at its slip."""
    wheel_runs: dict[Key, WheelRun] = {}
    for name, rows in stresses.groups():
        for wheel in dict.fromkeys(rows["wheel"].tolist()):
            own = rows.rows(rows["wheel"] == wheel)
            where = f"{stresses.source} lines {own.line[0]} to {own.line[-1]}, run {name}, {wheel}"
            order = np.argsort(own["angle_rad"], kind="stable")
            try:
                profile = StressProfile(own["angle_rad"][order], own["normal_Pa"][order])
            except InputError as error:
                raise TableError(f"{where}: {error}") from None
            std = noise.std(profile.normal)
            if "normal_Pa_std" in own:
                read = own["normal_Pa_std"][order]
                std = np.where(np.isnan(read), std, read)
            slip = _slip(own, slips.get((name, wheel)), where, runs)
            wheel_runs[name, wheel] = WheelRun(slip, profile, np.asarray(std, dtype=np.float64))
    return wheel_runs


def _slip(rows: Table, climbed: float | None, where: str, runs: str) -> float:
    """Slip of one wheel in one run, from the table of climbs or from that of stresses."""
    read = rows["slip"] if "slip" in rows else np.full(len(rows), np.nan)
    read = read[~np.isnan(read)]
    if len(read) and np.ptp(read) > 0.0:
        raise TableError(
            f"{where}: slip ranges from {read.min():g} to {read.max():g}; needed is one value"
        )
    if climbed is None and len(read) == 0:
        raise TableError(
            f"{where}: no slip; needed is column slip here, or this run and wheel in {runs}"
        )
    if climbed is None:
        return float(read[0])
    if len(read) and abs(read[0] - climbed) > SLIP_TOLERANCE:
        raise TableError(f"{where}: slip is {read[0]:.4g} here and {climbed:.4g} in {runs}")
    return climbed


def _slope(rows: Table, name: str) -> float:
    slope = rows["slope_rad"]
    if np.ptp(slope) > 0.0:
        raise TableError(
            f"{rows.place(1)}, column slope_rad: run {name} has slopes of {slope[0]:g} and "
            f"{slope[1]:g} rad; needed is one slope per run"
        )
    return float(slope[0])


def _has_both(rows: Table, name: str) -> bool:
    missing = [wheel for wheel in WHEELS if wheel not in rows["wheel"]]
    if missing:
        raise TableError(
            f"{rows.place(0)}: run {name} has no row for its {missing[0]} wheel; both wheels are "
            "needed"
        )
    return True


def _wheel(wheels: dict[Key, WheelRun], name: str, wheel: str, stresses: Table) -> WheelRun:
    if (name, wheel) not in wheels:
        raise TableError(
            f"{stresses.source}: no stress of the {wheel} wheel in run {name}, which is a climb"
        )
    return wheels[name, wheel]


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
