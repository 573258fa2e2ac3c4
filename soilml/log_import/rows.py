"""One row of the table for each steady window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.io.table import Table
from soilml.log_import.channels.gear_of_run import gear_of
from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.shared_errors import SharedError, shared_errors
from soilml.log_import.channels.wheel_quantities import constants_of, wheel_quantities
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.windows.mean_errors import mean_error, pooled_errors
from soilml.log_import.windows.slip_errors import travel_ratio
from soilml.log_import.windows.steady import Stretch
from soilml.quantities import column
from soilml.remarks import Remark

#: Quantities of a row that are means of samples.
AVERAGED = ("torque", "load", "drawbar_pull", "sinkage")
#: How many times the usual wandering, and how large a standard error of slip, a window may have.
_TIMES, _LEAST_ERROR = 6.0, 0.01
_FEWEST = 4  # Fewest windows that tell what is usual
#: Wandering of a pull over the load, and of a slip, s^0.5, that no steady window has.
_MOST_WANDERING = 0.15
_NO_SCATTER = 1e-9  # Share of a value below which a scatter is that of rounding
#: Largest slip of a row: at 1 the wheel spins on the spot, and r omega and v say no more.
_MOST_SLIP = 0.995


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


@dataclass(frozen=True)
class WheelSeries:
    """The quantities of one wheel in one run over time, and the stretches of the run."""

    run: str  # Name of the run in the table
    drive: str  # Name of the run in the log; several wheels share it
    time: Floats  # Grid (n,), s
    quantities: dict[str, Floats]  # Samples (n,) by name
    stretches: tuple[Stretch, ...]  # Steady windows and what is left out
    notes: tuple[Remark, ...] = ()  # What was repaired, tared or doubted in this run


def means_of(rows: Sequence[WindowRow]) -> dict[str, float | Floats]:
    """Means of the channels (rows,) by role, NaN where a row has none."""
    roles = dict.fromkeys(role for row in rows for role in row.means)
    return {role: np.asarray([row.means.get(role, np.nan) for row in rows]) for role in roles}


def values_of(rows: Sequence[WindowRow]) -> dict[str, Floats]:
    """Quantities and slope (rows,) by name, NaN where a row has none."""
    names = dict.fromkeys(name for row in rows for name in row.values)
    found = {n: np.asarray([row.values.get(n, np.nan) for row in rows]) for n in names}
    if any("slope" in row.means for row in rows):
        found["slope"] = np.asarray([row.means.get("slope", np.nan) for row in rows])
    return found


def plain_constants(log_map: LogMap, wheel: WheelMap) -> dict[str, float]:
    """The constants of a wheel by name, without their standard deviations."""
    return {name: c.value for name, c in constants_of(wheel, log_map.vehicle).items()}


def quantities_of(
    means: Mapping[str, float | Floats],
    log_map: LogMap,
    wheel: WheelMap,
    constants: Mapping[str, float],
) -> dict[str, Floats]:
    """The quantities of windows from the means of their channels."""
    found = wheel_quantities(means, wheel, log_map.vehicle, constants)
    return {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}


def shared_errors_of(
    log_map: LogMap, wheel: WheelMap, rows: Sequence[WindowRow]
) -> tuple[dict[str, Noise], list[SharedError]]:
    """The errors that rows of a wheel share by its constants; see `shared_errors`."""
    if not rows:
        return {}, []
    means = means_of(rows)
    return shared_errors(
        lambda constants: quantities_of(means, log_map, wheel, constants),
        constants_of(wheel, log_map.vehicle),
    )


def window_row(
    window: Stretch, inputs: Inputs, series: Mapping[str, Floats], log_map: LogMap, wheel: WheelMap
) -> WindowRow:
    """The row of a window; `series` are the quantities over time."""
    rows = np.asarray((inputs.time >= window.start) & (inputs.time <= window.stop))
    constants = plain_constants(log_map, wheel)
    means = {
        role: float(np.nanmean(values[rows])) if np.isfinite(values[rows]).any() else float("nan")
        for role, values in inputs.values.items()
    }
    means |= inputs.constants
    slip_error = _exact_speeds(means, inputs, rows, wheel, constants)
    values = {k: float(v) for k, v in quantities_of(means, log_map, wheel, constants).items()}
    std: dict[str, float] = {}
    if "slip" in inputs.values:
        std["slip"] = mean_error(inputs.values["slip"][rows], inputs.step)[1]
    elif slip_error is not None and np.isfinite(values.get("slip", np.nan)):
        # s = 1 - k driving, 1 / k - 1 braking
        std["slip"] = slip_error * (1.0 if values["slip"] >= 0.0 else (1.0 + values["slip"]) ** 2)
    for name in AVERAGED:
        if name in series and series[name].ndim and np.isfinite(series[name][rows]).any():
            mean, error, _ = mean_error(series[name][rows], inputs.step)
            if error > 1e-12 * abs(mean):
                std[name] = error
    return WindowRow(window, means, values, std)


def _exact_speeds(
    means: dict[str, float],
    inputs: Inputs,
    rows: NDArray[np.bool_],
    wheel: WheelMap,
    constants: Mapping[str, float],
) -> float | None:
    """Replace the mean speeds by slopes of places where there are some; the error of their ratio.

    None where slip does not follow from two measured speeds.
    """
    rim_role = next(
        (r for r in ("rim_speed", "wheel_angle", "wheel_speed") if r in wheel.channels), None
    )
    ground_role = next((r for r in ("position", "ground_speed") if r in wheel.channels), None)
    if rim_role is None or ground_role is None or "slip" in wheel.channels:
        return None
    places = inputs.places
    rim_is_place, ground_is_place = rim_role in places, ground_role in places
    n = int(rows.sum())
    scale = 1.0
    if rim_role != "rim_speed":
        scale = constants["radius"] / constants[f"{rim_role}.gear_ratio"]
    rate_key = "rim_speed" if rim_role == "rim_speed" else "wheel_speed"
    rim = places[rim_role][rows] if rim_is_place else _rate(inputs, rate_key, rows, n)
    ground = (
        places[ground_role][rows] if ground_is_place else _rate(inputs, "ground_speed", rows, n)
    )
    interval = max(inputs.intervals.get(role, 0.0) for role in (rim_role, ground_role))
    _, error, rim_rate, ground_rate = travel_ratio(
        step=inputs.step,
        rim=scale * rim,
        ground=ground,
        rim_is_place=rim_is_place,
        ground_is_place=ground_is_place,
        interval=interval,
    )
    if np.isfinite(rim_rate) and np.isfinite(ground_rate):
        means[rate_key], means["ground_speed"] = rim_rate / scale, ground_rate
    return error


def _rate(inputs: Inputs, role: str, rows: NDArray[np.bool_], n: int) -> Floats:
    if role in inputs.values:
        return inputs.values[role][rows]
    return np.full(n, inputs.constants[role])


def pool_errors(rows: Sequence[WindowRow]) -> None:
    """Draw the errors of the windows of one wheel to their usual size; see `pooled_errors`."""
    lengths = np.asarray([row.window.stop - row.window.start for row in rows])
    for name in ("slip", *AVERAGED):
        errors = np.asarray([row.std.get(name, np.nan) for row in rows])
        for row, error in zip(rows, pooled_errors(errors, lengths), strict=True):
            if name in row.std:
                row.std[name] = float(error)


def add_stated_errors(row: WindowRow, inputs: Inputs, log_map: LogMap, wheel: WheelMap) -> None:
    """Add the errors of each row that the map states, and those of the tare, in quadrature."""
    constants = plain_constants(log_map, wheel)
    for role, channel in wheel.channels.items():
        key = {"wheel_angle": "wheel_speed", "position": "ground_speed"}.get(role, role)
        if key not in row.means:
            continue
        size = float(channel.noise.std(row.means[key]))
        size = float(np.hypot(size, np.nan_to_num(inputs.tare_error.get(key, 0.0))))
        if size == 0.0:
            continue
        changed = {**row.means, key: row.means[key] + size}
        moved = quantities_of(changed, log_map, wheel, constants)
        for name in ("slip", *AVERAGED):
            if name in moved and np.isfinite(moved[name]) and name in row.values:
                change = float(moved[name]) - row.values[name]
                if change:
                    row.std[name] = float(np.hypot(row.std.get(name, 0.0), change))


def irregular_windows(runs: Sequence[Sequence[WindowRow]]) -> dict[tuple[int, int], Remark]:
    """Reasons by (run, window) for windows that are irregular in slip or in drawbar pull.

    The wandering of a window is the standard error of its mean times the square root of its
    length, which does not depend on the length. Hands on the carriage, a cable that tightens or a
    wheel that meets a stone raise it. A window is judged by the others of its own run, and in a run
    of few windows by what no rig shows, so that it stays or goes whatever else is imported.
    """
    found: dict[tuple[int, int], Remark] = {}
    for name, least in (("drawbar_pull", 0.0), ("slip", _LEAST_ERROR)):
        for i, rows in enumerate(runs):
            errors = np.asarray([row.std.get(name, np.nan) for row in rows])
            lengths = np.asarray([row.window.stop - row.window.start for row in rows])
            wandering = errors * np.sqrt(lengths)
            known = np.isfinite(errors)
            if known.sum() >= _FEWEST:
                limits = np.full(len(rows), _TIMES * float(np.median(wandering[known])))
            else:
                one = [
                    row.values.get("load", np.nan) if name == "drawbar_pull" else 1.0
                    for row in rows
                ]
                limits = _MOST_WANDERING * np.abs(one)
            for k in np.flatnonzero((wandering > limits) & (errors > least)):
                words = name.replace("_", " ")
                usual = float(limits[k]) / _TIMES
                than = "in the middle of the windows"
                if known.sum() < _FEWEST:
                    usual, than = float(limits[k]), "windows of any rig at most do"
                text = (
                    f"it is irregular: the {words} wanders {wandering[k] / usual:.2g} times as "
                    f"much as {than}, as if someone had touched the rig"
                )
                found[(i, int(k))] = Remark("irregular", text, (name,))
    return found


def unusable(
    row: WindowRow, dead: Mapping[str, str], needed: Sequence[str] = ("slip", "load")
) -> Remark | None:
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
    measured = [row.values.get(n, np.nan) for n in ("torque", "drawbar_pull", "sinkage")]
    measured.append(row.values.get("vibration", np.nan))
    if not np.isfinite(measured).any() and dead:
        role, why = next(iter(dead.items()))
        return Remark("dead-sensor", f"the sensor of [{role}] is dead: {why}", (role,))
    return None


def without_torque(table: Table) -> list[Remark]:
    """A remark where no row has a torque, without which there is no estimate on board."""
    if np.isfinite(table[column("torque")]).any():
        return []
    text = (
        "no row has a torque: give the map a [torque] or [motor_current]; estimate needs one, and "
        "identify a torque, a drawbar pull or a sinkage"
    )
    return [Remark("no-torque", text, ("torque",))]


def rows_as_table(
    groups: Sequence[tuple[WheelMap, Run, Sequence[WindowRow]]], log_map: LogMap
) -> Table:
    """The table of all windows, in order of runs, wheels and time."""
    lines: list[dict[str, Any]] = []
    for wheel, run, rows in groups:
        for row in rows:
            line: dict[str, Any] = {"run": f"{run.name}_{wheel.name}" if wheel.name else run.name}
            if wheel.name:
                line["wheel"] = wheel.name
            if gear := gear_of(wheel, run):
                line["gear"] = gear
            for name in ("slip", "load", "torque", "drawbar_pull", "sinkage", "vibration"):
                if name in row.values:
                    line[column(name)] = row.values[name]
                    std = row.std.get(name, float("nan"))
                    # a channel that was set has no scatter: its error is not known, and not zero
                    some = std > _NO_SCATTER * max(abs(row.values[name]), _NO_SCATTER)
                    line[f"{column(name)}_std"] = std if some else float("nan")
            if "speed" in row.values:
                line[column("speed")] = row.values["speed"]
            line[column("time")] = (row.window.start + row.window.stop) / 2.0
            if wheel.radius is not None and wheel.leg is None:
                # a model file of another wheel is refused, since slip is that of this radius
                line[column("wheel_radius")] = wheel.radius.value
            line["source"] = run.recordings[0].file.name
            lines.append(line)
    names = list(dict.fromkeys(name for line in lines for name in line))
    text = ("run", "wheel", "gear", "source")
    columns: dict[str, Any] = {}
    for name in names:
        if name in text:
            columns[name] = np.asarray([line.get(name, "") for line in lines], dtype=np.str_)
        else:
            columns[name] = np.asarray([line.get(name, np.nan) for line in lines], dtype=float)
    always = ("slip", "torque_Nm")  # blank where not measured
    for name in always if lines else ():
        columns.setdefault(name, np.full(len(lines), np.nan))
    columns = {
        name: values
        for name, values in columns.items()
        if name in (*always, *text) or np.isfinite(values).any()
    }
    return Table(columns, log_map.source)
