"""A drive without odometry: its table, its slips and soils row by row, and what to know of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError, TableError
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.read_table import Rows, as_table, check_table
from soilml.io.table import Table
from soilml.numerics.quantiles import chi_squared_quantile
from soilml.quantities import QUANTITIES
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_band
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import SOILS, force_table

WIDE = 0.3  # Width of a 90 % interval of slip from which on the slip is not determined
LIKELY = 0.5  # Probability from which on a ground is called hard, or a slip beyond the table
#: Rows whose misfit is judged together, and normal quantile beyond which it is not chance.
JUDGED, QUANTILE = 10, 3.72
LEAST_SHARE = 0.02  # Rim speed below which a wheel stands, over the fastest of the drive

FLAGS = {
    "standing": "all wheels stand: there is no slip",
    "wheel-stopped": "a wheel stands or turns against the others: not described, passed over",
    "not-steady": "the rims speed up or slow down: the force balance does not apply, passed over",
    "no-soil": "no soil of the prior explains torque and pull, a hard floor does: refused",
    "no-fit": "neither a soil of the prior nor a hard floor explains the torques: do not use them",
    "beyond": "more slip than the table has, or stuck: the slip is a lower limit",
    "not-determined": "the interval of the slip is wide",
    "torque-set-aside": "a torque is beyond what any soil carries: left out, as if not read",
}
#: Flags of rows without an answer.
REFUSED = ("standing", "wheel-stopped", "not-steady", "no-soil")


@dataclass(frozen=True)
class DriveRows:
    """Rows (n,) of a rover's k wheels."""

    wheels: tuple[str, ...]
    time: Floats  # s
    rim_speed: Floats  # m/s (n, k)
    torque: Floats  # N m (n, k); NaN where there is none
    load: Floats  # N (n, k)
    slope: Floats  # Pitch, rad, positive uphill (n,)


@dataclass(frozen=True, repr=False)
class DriveSlip(Result):
    """Speed (m/s), slips and soil of each row: 5, 50 and 95 %; NaN where refused."""

    rows: DriveRows
    speed: Floats  # (n, 3)
    slip: Floats  # (n, 3, k)
    names: tuple[str, ...]  # Of the p soil parameters
    soil: Floats  # (n, 3, p), SI units
    no_soil: Floats  # Probability of a hard floor (n,)
    flags: tuple[tuple[str, ...], ...]  # Codes of `FLAGS` of each row

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Which rows have an answer, (n,)."""
        return np.isfinite(self.speed[:, 1])

    def remarks(self) -> Iterator[Remark]:
        """What to know of the drive, by code."""
        count = len(self.flags)
        for code, text in FLAGS.items():
            rows = np.asarray([code in own for own in self.flags])
            if not rows.any():
                continue
            said = f"{int(rows.sum())} of {count} rows: {text}"
            if code == "not-determined":
                low, high = np.median(self.slip[rows][:, [0, 2]].max(axis=2), axis=0)
                said += f", {low:.2f} to {high:.2f} in the median"
            yield Remark(code, said, severity="note" if code == "standing" else "warning")

    def frame_columns(self) -> dict[str, Any]:
        """A row for each time in SI units: medians and 90 % intervals; refused rows are blank."""
        columns: dict[str, Any] = {"time_s": self.rows.time}
        columns |= _band("speed_m_s", self.speed)
        for i, name in enumerate(self.rows.wheels):
            columns |= _band(f"slip_{name}", self.slip[:, :, i])
        for i, name in enumerate(self.names):
            key = QUANTITIES[name].column if name in QUANTITIES else name
            columns |= _band(key, self.soil[:, :, i])
        columns["no_soil"] = self.no_soil
        columns["flags"] = np.asarray([" ".join(own) for own in self.flags])
        return columns

    def report(self, title: str = "Slip of a drive") -> Report:
        """The report of a drive: slips at its end, how well they are known, flags."""
        answered = self.answered
        count, known = len(answered), int(answered.sum())
        verdict = f"None of {count} rows has a slip: see the flags."
        lines = [
            f"{known} of {count} rows have a slip; {count - known} are refused or passed over."
        ]
        if known:
            slip = self.slip[answered].max(axis=2)
            low, middle, high = self.slip[np.flatnonzero(answered)[-1]].max(axis=1)
            verdict = (
                f"The largest slip of a wheel is {slip[:, 1].max():.2f}; at the last row it is "
            )
            verdict += f"{format_band(low, middle, high, digits=2)}."
            width = np.median(slip[:, 2] - slip[:, 0])
            lines.append(f"Half of the 90 % intervals are at most {width:.2f} wide.")
        flags = [name for own in self.flags for name in own]
        names = sorted(set(flags), key=flags.count, reverse=True)
        columns = [Column("flag", names), Column("rows", [flags.count(name) for name in names])]
        return Report(
            kind="slip",
            verdict=verdict,
            lines=lines,
            tables=[ReportTable("Flags", columns)] if names else [],
            pictures=[
                column_picture(
                    self.frame_columns() | {"pitch_rad": self.rows.slope},
                    "time_s",
                    [[f"slip_{name}" for name in self.rows.wheels], ["speed_m_s"], ["pitch_rad"]],
                    title="The drive",
                    caption="Lines: medians. Bands: 90 %.",
                )
            ],
            remarks=list(self.remarks()),
            status=f"{known} of {count} rows",
            tone="good" if known == count else "warn" if known else "bad",
            title=title,
            basis=f"{count} rows of {len(self.rows.wheels)} wheels",
        )  # fmt: skip

    def as_json(self) -> dict[str, Any]:
        """Columns and remarks."""
        columns = {
            name: np.asarray(values).tolist() for name, values in self.frame_columns().items()
        }
        return {"columns": columns, "remarks": [remark.as_json() for remark in self.remarks()]}


ENDS = ("_p05", "", "_p95")


def _band(name: str, values: Floats) -> dict[str, Floats]:
    """The median first, then the ends."""
    return {f"{name}{ENDS[j]}": values[:, j] for j in (1, 0, 2)}


def read_drive(table: Rows, case: Case) -> DriveRows:
    """The rows of a table that has one for each time and wheel.

    Columns: time_s, wheel, rim_speed_m_s or wheel_speed_rad_s, torque_Nm or current_A, slope_rad
    (the pitch), and, where known, roll_rad and load_N. Without load_N, the loads follow from
    [rover].

    Raises `TableError` for a missing column or cell, an unknown wheel, a time without each wheel,
    and wheels that all stand; `InputError` for a case without [rover].
    """
    table = as_table(table)
    rover = case.rover
    if rover is None:
        raise InputError("the model file has no [rover]; soilml drive slip needs mass and wheels")
    speed = _one_of(table, "rim_speed_m_s", "wheel_speed_rad_s")
    reading = _one_of(table, "torque_Nm", "current_A")
    need = ("time_s", "wheel", speed, "slope_rad", *(["load_N"] if "load_N" in table else []))
    table = with_rover_columns(case, check_table(table, Path(table.source), need, need, None))
    wheels = tuple(rover.wheels)
    order = _by_wheel(table, wheels)

    def each(name: str) -> Floats:
        return np.asarray(table[name][order])

    rim = each(speed)
    if speed == "wheel_speed_rad_s":
        models = [case.gears[w.gear] if w.gear else case.model for w in rover.wheels.values()]
        rim = rim * np.asarray([float(getattr(model.gear, "radius", 0.0)) for model in models])
    if not np.any(rim):
        raise TableError(f"{table.source}: all wheels stand still in every row, {speed} is 0")
    torque = each(reading)
    if not np.isfinite(torque).any():
        raise TableError(f"{table.source}: column {reading} has no value")
    if reading == "current_A":
        constant = case.drive.torque_per_ampere
        if constant is None:
            raise InputError(
                "the table has current_A in place of torque_Nm; needed is torque_per_ampere, in "
                "N m/A at the wheel, in [drive] of the model file"
            )
        torque = torque * constant
    slope = each("slope_rad")[:, 0]
    if "load_N" in table:
        load = each("load_N")
    else:
        roll = each("roll_rad")[:, 0] if "roll_rad" in table else np.zeros(len(slope))
        load = rover.loads(slope, np.nan_to_num(roll)).T
    return DriveRows(wheels, each("time_s")[:, 0], rim, torque, load, slope)


def _one_of(table: Table, name: str, other: str) -> str:
    """The one of two columns that a table has; raises `TableError` where it has none."""
    for own in (name, other):
        if own in table:
            return own
    raise TableError(f"{table.source}: column {name} is missing; needed is {name} or {other}")


def _by_wheel(table: Table, wheels: Sequence[str]) -> NDArray[np.int64]:
    """Positions (n, k) of the rows of each time and wheel."""
    times = np.unique(table["time_s"])
    order = np.full((len(times), len(wheels)), -1)
    at = np.searchsorted(times, table["time_s"])
    number = np.asarray([wheels.index(name) for name in table["wheel"]])
    order[at, number] = np.arange(len(table))
    if len(table) != order.size or (order < 0).any():
        time = times[np.argmax((order < 0).any(axis=1))]
        raise TableError(
            f"{table.source}: needed is one row for each of the {len(wheels)} wheels of [rover] at "
            f"each time; {len(table)} rows have {len(times)} times, see time_s {time:g}"
        )
    return order


def slip_of_drive(case: Case, rows: Rows | DriveRows, *, soils: int = SOILS) -> DriveSlip:
    """Slip of each wheel, body speed and soil along a drive, from torque and force balance.

    case: With a rover, priors of the soil, noise of the torque, and errors of the drives.
    rows: A table as `read_drive` takes it, or its rows.
    soils: Number of draws of the prior that stand for all soils.

    Each answer knows the rows up to its own. Raises as `read_drive` and `force_table` do. Equations
    and where they do not hold: `SlipFilter`.
    """
    drive = rows if isinstance(rows, DriveRows) else read_drive(rows, case)
    assert case.rover is not None
    table = force_table(case, (float(drive.load.min()), float(drive.load.max())), soils)
    own = case.noise.get("torque_Nm")
    noise = (0.0, 0.02) if own is None else (own.constant, own.share)
    filter_ = SlipFilter(table, case.rover.weight, case.drive, noise)
    n, k, p = len(drive.time), len(drive.wheels), len(table.names)
    speed, slip, soil = (np.full((n, 3, *size), np.nan) for size in ((), (k,), (p,)))
    no_soil, misfit, flags = np.full(n, np.nan), [], []
    belief = filter_.start()
    for i, before in enumerate(_before(drive, case)):
        if before:
            flags.append(before)
            continue
        way = 1.0 if drive.rim_speed[i, 0] > 0.0 else -1.0  # in reverse all signs change
        answer, belief = filter_.step(
            belief,
            way * drive.rim_speed[i],
            way * drive.torque[i],
            drive.load[i],
            way * float(drive.slope[i]),
        )
        misfit.append(answer.misfit)
        no_soil[i] = answer.no_soil
        found = list(_after(answer.no_soil, answer.beyond, misfit, answer.slip, k))
        if (np.abs(drive.torque[i]) > filter_.most_torque).any():
            found.append("torque-set-aside")
        flags.append(tuple(found))
        if "no-soil" not in found:
            ends = answer.speed if way > 0.0 else -answer.speed[::-1]
            speed[i], slip[i], soil[i] = ends, answer.slip, answer.soil
    return DriveSlip(drive, speed, slip, table.names, soil, no_soil, tuple(flags))


def _before(drive: DriveRows, case: Case) -> Iterator[tuple[str, ...]]:
    """Flags of rows that are passed over; empty for others."""
    assert case.rover is not None
    moving = np.abs(drive.rim_speed) > LEAST_SHARE * np.abs(drive.rim_speed).max()
    alike = np.abs(np.sign(drive.rim_speed).sum(axis=1)) == len(drive.wheels)
    change: Floats = np.diff(drive.rim_speed.mean(axis=1), prepend=drive.rim_speed[0].mean())
    passed: Floats = np.diff(drive.time, prepend=drive.time[0] - 1.0)
    uneven = np.abs(change / passed) / case.rover.gravity
    for i in range(len(drive.time)):
        if not moving[i].any():
            yield ("standing",)
        elif not (moving[i].all() and bool(alike[i])):
            yield ("wheel-stopped",)
        else:
            yield ("not-steady",) if uneven[i] > case.drive.pull_std else ()


def _after(
    no_soil: float, beyond: float, misfit: Sequence[float], slip: Floats, wheels: int
) -> Iterator[str]:
    """Flags of an answer."""
    if no_soil > LIKELY:
        yield "no-soil"
        return
    degrees = float(JUDGED * wheels)
    limit = chi_squared_quantile(degrees, QUANTILE) / degrees
    if len(misfit) >= JUDGED and np.mean(misfit[-JUDGED:]) > limit:
        yield "no-fit"
    if beyond > LIKELY:
        yield "beyond"
    if np.max(slip[2] - slip[0]) > WIDE:
        yield "not-determined"
