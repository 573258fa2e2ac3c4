"""The tables of runs, of rim stresses and of sensor readings, and what they are together."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError, TableError
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.systems.rim_stress.climbs import WHEELS, Climb, WheelRun
from soilml.systems.rim_stress.force_balance import SteadyRun
from soilml.systems.rim_stress.stress import (
    MeasuredStress,
    SensingWheel,
    StressProfile,
    bin_stress,
)

STRESS, READINGS = ("run", "angle_rad", "normal_Pa"), ("run", "angle_rad", "sensor", "force_N")
SPEEDS = ("speed_m_s", "rim_speed_m_s")
#: Fewest points of a profile whose scatter tells its noise; 20 is the variance of the third
#: difference of unit noise, 0.798 the mean size of a standard normal number.
_FEWEST, _THIRD, _MEAN = 8, 20.0, 0.798

Key = tuple[str, str]  # Run and wheel


@dataclass(frozen=True)
class ClimbData:
    """Climbs, and stresses of front and rear wheels at slips elsewhere, such as level ground."""

    climbs: tuple[Climb, ...]
    level: tuple[list[WheelRun], list[WheelRun]]

    def climbed(self, i: int) -> list[WheelRun]:
        """The runs of wheel i of `WHEELS` in the climbs."""
        return [climb.wheels[i] for climb in self.climbs]


def noise_by_scatter(normal: Floats) -> Floats:
    """Standard deviation (points,) by the scatter about a smooth course, a share of the stress."""
    if len(normal) < _FEWEST or not normal.any():
        return np.zeros(len(normal))
    level = np.convolve(normal, np.full(4, 0.25), "valid")
    share = np.abs(np.diff(normal, 3))[level > 0.0] / level[level > 0.0]
    return np.asarray(float(np.mean(share)) / math.sqrt(_THIRD) / _MEAN * normal)


def read_steady_runs(path: str) -> dict[str, SteadyRun]:
    """Runs of one wheel, a row each; raises `TableError` naming file and row."""
    table = read_table(path, need := ("run", "slip", "load_N"), filled=need)
    fields = {"slip": "slip", "weight": "load_N", "slope": "slope_rad"}
    runs = {}
    for name, rows in table.groups():
        if len(rows) > 1:
            raise TableError(f"{path}: run {name} has {len(rows)} rows; needed is one")
        values = {
            f"{field}{std}": float(rows[f"{column}{std}"][0])
            for field, column in fields.items()
            for std in ("", "_std")
            if f"{column}{std}" in rows
        }
        runs[name] = SteadyRun(**values)
    return runs


def read_stresses(path: str, discs: SensingWheel | None = None) -> dict[str, MeasuredStress]:
    """The stress of each run of one wheel from its rows, in any order.

    Its standard deviation is the column `normal_Pa_std`, else that of the scatter. Of round sensors
    (`discs`), points below twice the deadband may have samples that read nothing. Raises
    `TableError` for a run whose rows are no profile.
    """
    table = read_table(path, STRESS, filled=STRESS)
    return {
        name: _stress(rows, noise_by_scatter, f", run {name}", discs)
        for name, rows in table.groups()
    }


def read_readings(path: str, wheel: SensingWheel) -> dict[str, MeasuredStress]:
    """The stress of each run of one wheel from the samples of its sensors over some turns."""
    table, found = read_table(path, READINGS, filled=READINGS), {}
    for name, rows in table.groups():
        try:
            found[name] = bin_stress(rows.columns, wheel)
        except InputError as error:
            raise TableError(f"{path}, run {name}: {error}") from None
    return found


def _stress(
    rows: Table,
    noise: Callable[[Floats], Floats],
    where: str,
    discs: SensingWheel | None = None,
) -> MeasuredStress:
    order = np.argsort(rows["angle_rad"], kind="stable")
    angle, normal = rows["angle_rad"][order], rows["normal_Pa"][order]
    try:
        StressProfile(angle, normal)
    except InputError as error:
        lines = f" lines {rows.line[0]} to {rows.line[-1]}" if len(rows.line) else ""
        raise TableError(f"{rows.source}{lines}{where}: {error}") from None
    std = np.asarray(noise(normal), dtype=np.float64)
    if "normal_Pa_std" in rows:
        read = rows["normal_Pa_std"][order]
        std = np.where(np.isnan(read), std, read)
    least = 0.0 if discs is None else 2.0 * float(discs.deadband) / discs.area
    return MeasuredStress(angle, normal, std, normal > least)


def read_climb_data(
    runs: str, stress_path: str, noise: Noise, *, ignore_extra: bool = False
) -> ClimbData:
    """Read a table of runs and one of stresses; raises `TableError` naming file and row.

    A climb has one row for its front and one for its rear wheel, and stresses of both. A run
    without a slope, such as artificial slip on level ground, may have one of them. `noise` is that
    of the stress where the table has no normal_Pa_std.
    """
    need = ("run", "wheel", "slope_rad")
    filled = ("run", "wheel", "slip", *SPEEDS)
    driven = read_table(runs, need, filled=filled, ignore_extra=ignore_extra)
    own = ("wheel", *STRESS)
    stresses = read_table(stress_path, own, filled=own, ignore_extra=ignore_extra)
    for table, known in ((driven, ()), (stresses, ("normal_Pa_std",))):
        for name in table.columns:
            if name.endswith("_std") and name not in known:
                raise TableError(f"{table.source}: column {name} is not read; set it in [noise]")
        odd = ~np.isin(table["wheel"], WHEELS)
        if odd.any():
            row = int(np.argmax(odd))
            raise TableError(
                f"{table.place(row)}, column wheel: {str(table['wheel'][row])!r} given; needed is "
                "front or rear"
            )
    slips, found = _slips(driven), dict[Key, WheelRun]()
    for name, rows in stresses.groups():
        for wheel in dict.fromkeys(rows["wheel"].tolist()):
            where = f", run {name}, {wheel}"
            if (name, wheel) not in slips:
                raise TableError(
                    f"{stresses.source}{where}: no slip; needed is a row of this wheel in {runs}"
                )
            stress = _stress(rows.rows(rows["wheel"] == wheel), noise.std, where)
            profile = StressProfile(stress.angle, stress.normal)
            found[name, wheel] = WheelRun(slips[name, wheel], profile, stress.std)
    climbs = []
    for name, rows in driven.groups():
        slope = rows["slope_rad"]
        if np.isnan(slope).all():
            continue
        if not np.ptp(slope) == 0.0:
            raise TableError(
                f"{rows.place(1)}, column slope_rad: run {name} has slopes of {slope[0]:g} and "
                f"{slope[1]:g} rad; needed is one slope per run"
            )
        for wheel in WHEELS:
            where, what = rows.place(0), f"run {name} has no row for its {wheel} wheel"
            if wheel in rows["wheel"]:
                where, what = stresses.source, f"no stress of the {wheel} wheel in climb {name}"
            if (name, wheel) not in found:
                raise TableError(f"{where}: {what}; both wheels are needed")
        climbs.append(Climb(name, float(slope[0]), *(found[name, wheel] for wheel in WHEELS)))
    names = {climb.name for climb in climbs}
    front, rear = (
        [run for (name, w), run in found.items() if w == wheel and name not in names]
        for wheel in WHEELS
    )
    return ClimbData(tuple(climbs), (front, rear))


def _slips(driven: Table) -> dict[Key, float]:
    """The slip of each wheel of each run: its column, or by the speeds of body and rim."""
    if "slip" in driven:
        slip, source = driven["slip"], "slip"
    elif all(name in driven for name in SPEEDS):
        speed, rim = (driven[name] for name in SPEEDS)
        largest, source = np.maximum(speed, rim), "speed_m_s"
        with np.errstate(invalid="ignore", divide="ignore"):
            slip = np.where(largest > 0.0, (rim - speed) / largest, np.nan)
    else:
        raise TableError(
            f"{driven.source}: column slip is missing; needed is slip, or speed_m_s and "
            "rim_speed_m_s of each wheel"
        )
    slips: dict[Key, float] = {}
    for row, key in enumerate(zip(driven["run"].tolist(), driven["wheel"].tolist(), strict=True)):
        if key in slips:
            raise TableError(
                f"{driven.place(row)}: run {key[0]} has a second row for its {key[1]} wheel; "
                "give each repetition a name of its own"
            )
        if not abs(slip[row]) < 1.0:
            raise TableError(
                f"{driven.place(row)}, column {source}: gives slip {slip[row]:.3g}; needed is a "
                "slip between -1 and 1"
            )
        slips[key] = float(slip[row])
    return slips
