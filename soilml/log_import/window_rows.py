"""One row of the table for each steady window."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.channels.wheel_quantities import constants_of, wheel_quantities
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.recording import Floats
from soilml.log_import.windows.mean_errors import mean_error
from soilml.log_import.windows.pooled_errors import pooled_errors
from soilml.log_import.windows.slip_errors import travel_ratio
from soilml.log_import.windows.steady import Stretch

#: Quantities of a row that are means of samples.
AVERAGED = ("torque", "load", "drawbar_pull", "sinkage")


@dataclass(frozen=True)
class WindowRow:
    """A window: means of the channels, the quantities that follow, and their standard deviations.

    Attributes
    ----------
    means
        Means of the channels by role, from which the quantities follow.
    values, std
        Quantities and their independent standard deviations, in SI units; no std where a quantity
        is a constant of the map.
    """

    window: Stretch
    means: dict[str, float]
    values: dict[str, float]
    std: dict[str, float]


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


def window_row(
    window: Stretch,
    inputs: Inputs,
    series: Mapping[str, Floats],
    log_map: LogMap,
    wheel: WheelMap,
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
        inputs.step, scale * rim, ground, rim_is_place, ground_is_place, interval
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
