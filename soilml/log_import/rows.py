"""Rows of the table: steady windows of a run, or lines of a table whose rows are steady runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.table import TEXT, Table
from soilml.log_import.channels.inputs import Inputs, channel_constant, combined, our_slip
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.mapping.channel_map import ROTATIONS, TRAVELS, ChannelMap
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.windows.mean_errors import mean_error, pooled_errors, travel_ratio
from soilml.log_import.windows.steady import Stretch
from soilml.quantities import column
from soilml.remarks import Remark

#: Quantities of a row that are means of samples, and all that have a standard deviation.
AVERAGED = ("torque", "load", "drawbar_pull", "sinkage")
_UNCERTAIN = ("slip", *AVERAGED)
#: How many times the usual wandering, and how large a standard error of slip, a window may have.
_TIMES, _LEAST_ERROR = 6.0, 0.01
_FEWEST = 4  # Fewest windows that tell what is usual
#: Wandering of a pull over the load, and of a slip, s^0.5, that no steady window has.
_MOST_WANDERING = 0.15
_NO_SCATTER = 1e-9  # Share of a value below which a scatter is that of rounding
#: Largest slip of a window: at 1 the wheel spins on the spot, and r omega and v say no more.
_MOST_SLIP = 0.995
#: Quantities that no channel is, which logs may have as columns of our names.
_CARRIED = ("wheel_radius", "wheel_width", "slip_angle", "pass", "progress", "load_direction")
_OF_SAMPLES = ("wheel_angle", "position")  # Channels that only samples over time can be


@dataclass(frozen=True)
class WindowRow:
    """A window: means of the channels, the quantities that follow, and their standard deviations.

    means: Means of the channels by role, from which the quantities follow.
    values, std: Quantities and their independent standard deviations, in SI units; no std where a
        quantity is a constant of the map.
    """

    window: Stretch
    means: dict[str, float]
    values: dict[str, float]
    std: dict[str, float]


def by_name(dictionaries: Sequence[Mapping[str, float]]) -> dict[str, Floats]:
    """Numbers of rows as columns (rows,), NaN where a row has none."""
    names = dict.fromkeys(name for one in dictionaries for name in one)
    return {name: np.asarray([one.get(name, np.nan) for one in dictionaries]) for name in names}


def window_row(
    window: Stretch,
    inputs: Inputs,
    series: Mapping[str, Floats],
    run: Run,
    conversion: Conversion,
    within: Stretch | None = None,
) -> WindowRow:
    """The row of a window; `series` are the quantities over time.

    Sensors are averaged over the part `within` it, else over all of it; slip is that of all of it.
    """
    rows = inputs.within(window.start, window.stop)
    part = rows if within is None else inputs.within(within.start, within.stop)
    means = {
        role: float(np.nanmean(values[part])) if np.isfinite(values[part]).any() else float("nan")
        for role, values in inputs.values.items()
    } | inputs.constants
    slip_error = _exact_speeds(means, inputs, rows, conversion)
    values = {k: float(v) for k, v in conversion.of(means).items()}
    std: dict[str, float] = {}
    if "slip" in inputs.values:
        std["slip"] = mean_error(inputs.values["slip"][rows], inputs.step)[1]
    elif slip_error is not None and np.isfinite(values.get("slip", np.nan)):
        # s = 1 - k driving, 1 / k - 1 braking
        std["slip"] = slip_error * (1.0 if values["slip"] >= 0.0 else (1.0 + values["slip"]) ** 2)
    for name in AVERAGED:
        if name in series and series[name].ndim and np.isfinite(series[name][part]).any():
            mean, error, _ = mean_error(series[name][part], inputs.step)
            if error > 1e-12 * abs(mean):
                std[name] = error
    sizes = {name: float(np.nanmedian(v)) for name, v in _carried(run).items()}
    return WindowRow(window, means, values | sizes, std)


def _carried(run: Run) -> dict[str, Floats]:
    """What a log has in columns of our names, (n,); the first pass is 1, and 0 means another."""
    held = [recording.columns for recording in run.recordings]
    return {name: own[column(name)] for own in held for name in _CARRIED if column(name) in own
            and not (name == "pass" and np.any(own[name] < 1.0))}  # fmt: skip


def _exact_speeds(
    means: dict[str, float], inputs: Inputs, rows: NDArray[np.bool_], conversion: Conversion
) -> float | None:
    """Replace the mean speeds by slopes of places where there are some; the error of their ratio.

    None where slip does not follow from two measured speeds.
    """
    channels, constants = conversion.wheel.channels, conversion.values
    rim_role = next((r for r in ROTATIONS if r in channels), None)
    ground_role = next((r for r in TRAVELS if r in channels), None)
    if rim_role is None or ground_role is None or "slip" in channels:
        return None
    scale, rim_key = 1.0, "rim_speed"
    if rim_role != "rim_speed":
        rim_key = "wheel_speed"
        scale = constants["radius"] / constants[f"{rim_role}.gear_ratio"]

    def samples(role: str, key: str) -> Floats:
        found = inputs.places.get(role, inputs.values.get(key))
        return np.full(int(rows.sum()), inputs.constants[key]) if found is None else found[rows]

    _, error, rim_rate, ground_rate = travel_ratio(
        step=inputs.step,
        rim=scale * samples(rim_role, rim_key),
        ground=samples(ground_role, "ground_speed"),
        rim_is_place=rim_role in inputs.places,
        ground_is_place=ground_role in inputs.places,
        interval=max(inputs.intervals.get(role, 0.0) for role in (rim_role, ground_role)),
    )
    if np.isfinite(rim_rate) and np.isfinite(ground_rate):
        means[rim_key], means["ground_speed"] = rim_rate / scale, ground_rate
    return error


def propagated(
    conversion: Conversion, means: Mapping[str, Any], errors: Mapping[str, Any]
) -> dict[str, Floats]:
    """Standard deviations (...) of the quantities by those of the channels (...), by role."""
    values: dict[str, Floats] = conversion.of(means)
    std: dict[str, Floats] = {}
    for role, error in errors.items():
        if np.any(error > 0.0):
            moved = conversion.of({**means, role: means[role] + np.nan_to_num(error)})
            for name in {*_UNCERTAIN} & moved.keys() & values.keys():
                change = np.nan_to_num(np.abs(moved[name] - values[name]))
                std[name] = np.hypot(std.get(name, 0.0), change)
    return std


def table_rows(run: Run, conversion: Conversion) -> list[WindowRow]:
    """The rows of a table in which each row is a steady run, with their standard deviations.

    These are those of the columns `std` of the map, with its `noise` in addition. Raises
    `InputError` for a channel that needs samples over time.
    """
    count = len(run.recordings[0])
    means: dict[str, Floats] = {}
    errors: dict[str, Floats] = {}
    for role, channel in conversion.wheel.channels.items():
        if role in _OF_SAMPLES or channel.tare is not None:
            raise InputError(
                f"[{role}] needs samples over time, and [runs] each_row says that each row is a "
                "steady run; needed is a speed or [slip], and no tare"
            )
        means[role], errors[role] = _readings(run, channel, count)
    std = propagated(conversion, means, errors)

    def by_row(found: Mapping[str, Floats]) -> list[dict[str, float]]:
        whole = {name: np.broadcast_to(values, (count,)).tolist() for name, values in found.items()}
        return [{name: values[i] for name, values in whole.items()} for i in range(count)]

    parts = (by_row(found) for found in (means, conversion.of(means) | _carried(run), std))
    return [
        WindowRow(Stretch(time, time), own, values, {k: v for k, v in error.items() if v > 0.0})
        for time, own, values, error in zip(run.times[0].tolist(), *parts, strict=True)
    ]


def _readings(run: Run, channel: ChannelMap, count: int) -> tuple[Floats, Floats]:
    """Readings (rows,) in the units of soilml, and their standard errors, 0 where not known."""
    if not channel.columns:
        return np.full(count, channel_constant(run, channel)), np.zeros(count)
    columns = [run.find(address)[1] for address in channel.columns]
    of_slip = channel.role == "slip"  # whose definition comes last
    given = channel.scale * columns[0] if of_slip else combined(channel, columns)
    error = np.asarray(channel.noise.std(given), dtype=np.float64) * np.ones(count)
    if channel.std_column:
        stated = channel.std_scale * np.abs(run.find(channel.std_column)[1])
        stated = stated * np.abs(given) if channel.std_is_share else stated
        error = np.hypot(error, np.nan_to_num(stated))
    if not of_slip:
        return given, error
    ours = our_slip(given, channel.definition)
    return ours, np.abs(our_slip(given + error, channel.definition) - ours)


def pool_errors(rows: Sequence[WindowRow]) -> None:
    """Draw the errors of the windows of one wheel to their usual size; see `pooled_errors`."""
    lengths = np.asarray([row.window.stop - row.window.start for row in rows])
    for name in _UNCERTAIN:
        errors = np.asarray([row.std.get(name, np.nan) for row in rows])
        for row, error in zip(rows, pooled_errors(errors, lengths), strict=True):
            if name in row.std:
                row.std[name] = float(error)


def add_stated_errors(row: WindowRow, inputs: Inputs, conversion: Conversion) -> None:
    """Add the errors of each row that the map states, and those of the tare, in quadrature."""
    errors = {}
    for role, channel in conversion.wheel.channels.items():
        key = {"wheel_angle": "wheel_speed", "position": "ground_speed"}.get(role, role)
        if key in row.means:
            tare = float(np.nan_to_num(inputs.tare_error.get(key, 0.0)))
            errors[key] = float(np.hypot(channel.noise.std(row.means[key]), tare))
    for name, change in propagated(conversion, row.means, errors).items():
        if change and name in row.values:
            row.std[name] = float(np.hypot(row.std.get(name, 0.0), change))


def irregular_windows(rows: Sequence[WindowRow]) -> dict[int, Remark]:
    """Reasons by place for windows of a run that are irregular in slip or in drawbar pull.

    The wandering of a window is the standard error of its mean times the square root of its
    length, which does not depend on the length. Hands on the carriage, a cable that tightens or a
    wheel that meets a stone raise it. A window is judged by the others of its own run, and in a run
    of few windows by what no rig shows, so that it stays or goes whatever else is imported.
    """
    found: dict[int, Remark] = {}
    for name, least in (("drawbar_pull", 0.0), ("slip", _LEAST_ERROR)):
        errors = np.asarray([row.std.get(name, np.nan) for row in rows])
        wandering = errors * np.sqrt([row.window.stop - row.window.start for row in rows])
        if np.isfinite(errors).sum() < _FEWEST:
            times, other = 1.0, "windows of any rig at most do"
            loads = np.abs([row.values.get("load", np.nan) for row in rows])
            usual = _MOST_WANDERING * (loads if name == "drawbar_pull" else np.ones(len(rows)))
        else:
            times, other = _TIMES, "in the middle of the windows"
            usual = np.full(len(rows), float(np.nanmedian(wandering)))
        for k in np.flatnonzero((wandering > times * usual) & (errors > least)):
            text = (
                f"it is irregular: the {name.replace('_', ' ')} wanders "
                f"{wandering[k] / usual[k]:.2g} times as much as {other}, as if someone had "
                "touched the rig"
            )
            found[int(k)] = Remark("irregular", text, (name,))
    return found


def unusable(row: WindowRow, dead: Mapping[str, str], needed: Sequence[str]) -> Remark | None:
    """Why a window cannot be a row; None where it can. `dead` are the sensors, with the reason."""
    for name in needed:
        if not np.isfinite(row.values.get(name, np.nan)):
            why = f": {dead[name]}" if name in dead else ""
            return Remark("unknown-quantity", f"its {name} is not known{why}", (name,))
    if "slip" in needed and not abs(row.values["slip"]) < _MOST_SLIP:
        text = f"its slip is {row.values['slip']:.3g}: the wheel spins on the spot, or locks"
        return Remark("slip-out-of-range", text, ("slip",))
    if row.values["load"] <= 0.0:
        return Remark("load-out-of-range", f"its load is {row.values['load']:.3g} N", ("load",))
    measured = ("torque", "drawbar_pull", "sinkage", "vibration")
    if dead and not any(np.isfinite(row.values.get(name, np.nan)) for name in measured):
        role, why = next(iter(dead.items()))
        return Remark("dead-sensor", f"the sensor of [{role}] is dead: {why}", (role,))
    return None


def rows_as_table(
    groups: Sequence[tuple[WheelMap, Run, Sequence[WindowRow]]], source: str, timed: bool = True
) -> Table:
    """The table of all rows, in order of runs, wheels and time; without times where not `timed`."""
    lines: list[dict[str, Any]] = []
    for wheel, run, rows in groups:
        named = {"run": f"{run.name}_{wheel.name}" if wheel.name else run.name}
        named |= {"wheel": wheel.name} if wheel.name else {}
        named |= {"gear": wheel.gear} if wheel.gear else {}
        for row in rows:
            line: dict[str, Any] = dict(named)
            for name in (*_UNCERTAIN, "vibration"):
                if name in row.values:
                    line[column(name)] = row.values[name]
                    std = row.std.get(name, float("nan"))
                    # a channel that was set has no scatter: its error is not known, and not zero
                    some = std > _NO_SCATTER * max(abs(row.values[name]), _NO_SCATTER)
                    line[f"{column(name)}_std"] = std if some else float("nan")
            line |= {column(n): row.values[n] for n in ("speed", *_CARRIED) if n in row.values}
            if timed:
                line[column("time")] = (row.window.start + row.window.stop) / 2.0
            if wheel.radius is not None and wheel.leg is None:
                # a model file of another wheel is refused, since slip is that of this radius
                line.setdefault(column("wheel_radius"), wheel.radius.value)
            lines.append(line | {"source": run.recordings[0].file.name})
    always = ("slip", "torque_Nm")  # blank where not measured
    columns: dict[str, Any] = {}
    for name in dict.fromkeys([*(n for line in lines for n in line), *(always if lines else ())]):
        if name in TEXT:
            columns[name] = np.asarray([line.get(name, "") for line in lines], dtype=np.str_)
        else:
            values = np.asarray([line.get(name, np.nan) for line in lines], dtype=float)
            if name in always or np.isfinite(values).any():
                columns[name] = values
    return Table(columns, source)
