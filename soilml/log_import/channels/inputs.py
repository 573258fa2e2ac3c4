"""The channels of one wheel on one grid, in the units of soilml, tared."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.cell_text import read_number
from soilml.log_import.channels.resampling import (
    derivative,
    on_grid,
    sampling_interval,
    uniform_grid,
    unwrapped,
)
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.wheel_quantities import slope_of
from soilml.log_import.mapping.channel_map import ChannelMap
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.windows.mean_errors import mean_error
from soilml.log_import.windows.stances import without_spikes
from soilml.remarks import Remark

SMOOTH = 0.5  # Span of the derivative of places and angles, s
#: Share of the usual rotation speed below which a wheel stands still; shortest rest, and what is
#: left out before the start, s.
_STANDS, _SHORTEST_REST, _BEFORE_START = 0.05, 0.4, 0.2
#: Channels of a wheel-leg in which single wild samples are left out.
_DESPIKED = ("torque", "motor_current", "load", "drawbar_pull", "sinkage", "clearance", "vibration")
_PLACES = ("wheel_angle", "position")
_EFFORT = 0.1  # Share of the usual torque or current that is more than noise and offset


@dataclass
class Inputs:
    """Samples of the channels of one wheel."""

    time: Floats  # Grid (n,), s after the start of the run
    # Samples (n,) by role, as the sensors see them: before gearboxes
    values: dict[str, Floats] = field(default_factory=dict)
    # Roles that were given as angle or place, of which `values` has the rates under `wheel_speed`
    # and `ground_speed`; here as they were given
    places: dict[str, Floats] = field(default_factory=dict)
    # Sampling interval of the places in the log, s, by role; on the grid they are interpolated
    intervals: dict[str, float] = field(default_factory=dict)
    # Roles that do not vary, with their value
    constants: dict[str, float] = field(default_factory=dict)
    # Mean at rest and its standard error by role; empty where the wheel never rests
    rest: dict[str, tuple[float, float]] = field(default_factory=dict)
    tare: dict[str, float] = field(default_factory=dict)  # What was subtracted by role
    tare_error: dict[str, float] = field(default_factory=dict)  # Standard error of the tare by role
    notes: list[Remark] = field(default_factory=list)  # What was tared, and what could not be

    @property
    def step(self) -> float:
        """Step of the grid, s."""
        return float(self.time[1] - self.time[0])


def wheel_inputs(run: Run, wheel: WheelMap) -> Inputs:
    """The channels of a wheel in a run.

    Raises `InputError` for a column that the run lacks, and where channels do not overlap in time.
    """
    raw: dict[str, list[tuple[Floats, Floats]]] = {}
    constants = {}
    for role, channel in wheel.channels.items():
        if channel.columns:
            raw[role] = [run.find(address) for address in channel.columns]
        else:
            constants[role] = channel_constant(run, channel)
    parts = [part for several in raw.values() for part in several]
    if not parts:
        raise InputError(f"run {run.name}: the map names no column")
    intervals = [sampling_interval(times, values) for times, values in parts]
    if not np.isfinite(min(intervals)):
        raise InputError(f"run {run.name}: no channel has two samples with a time")
    starts = [times[0] for times, _ in parts]
    stops = [times[-1] for times, _ in parts]
    if not max(starts) < min(stops):
        raise InputError(
            f"run {run.name}: the recordings do not overlap in time ({max(starts):.6g} s to "
            f"{min(stops):.6g} s); where their clocks differ, write clock = 'start' in [files]"
        )
    grid = uniform_grid(intervals, max(starts), min(stops))
    if grid.size < 8:
        raise InputError(f"run {run.name} has {grid.size} samples; needed are 8 or more")
    inputs = Inputs(grid, constants=constants)
    for role, several in raw.items():
        channel = wheel.channels[role]
        if channel.unwrap:
            several = [(t, unwrapped(v, channel.unwrap)) for t, v in several]
        if wheel.leg is not None and role in _DESPIKED:
            several = _despiked(inputs, role, several)
        if role in _PLACES:
            inputs.intervals[role] = max(sampling_interval(t, v) for t, v in several)
        sampled = [on_grid(grid, t, v, continuous=role in _PLACES) for t, v in several]
        _add(inputs, channel, sampled)
    _tare(inputs, wheel)
    return inputs


def _despiked(
    inputs: Inputs, role: str, several: list[tuple[Floats, Floats]]
) -> list[tuple[Floats, Floats]]:
    """Samples without single wild ones, which the largest acceleration of a stance would be."""
    found = [(times, *without_spikes(values)) for times, values in several]
    if count := sum(wild for *_, wild in found):
        text = f"[{role}]: {count} single wild samples are left out"
        inputs.notes.append(Remark("spikes", text, (role,), severity="note"))
    return [(times, values) for times, values, _ in found]


def _add(inputs: Inputs, channel: ChannelMap, sampled: list[Floats]) -> None:
    """Add a channel in the units of soilml; places are added with their rate."""
    role, grid = channel.role, inputs.time
    if role == "position":
        place = channel.scale * along_path(sampled)
        inputs.places[role] = place
        inputs.values.setdefault("ground_speed", derivative(grid, place, SMOOTH))
    elif role == "wheel_angle":
        place = channel.scale * sampled[0]
        inputs.places[role] = place
        inputs.values.setdefault("wheel_speed", derivative(grid, place, SMOOTH))
    elif role == "slip":
        inputs.values[role] = our_slip(channel.scale * sampled[0], channel.definition)
    else:
        inputs.values[role] = combined(channel, sampled)


def combined(channel: ChannelMap, columns: list[Floats]) -> Floats:
    """A channel (n,) in the unit of soilml, of its columns (n,).

    Cells that carry the wheel together add up, sensors of one sinkage are averaged.
    """
    if channel.role == "slope":
        return channel.scale * slope_of(columns)
    total = channel.scale * sum(columns[1:], start=columns[0])
    return total / len(columns) if channel.role == "sinkage" else total


def our_slip(given: Any, definition: str) -> Any:
    """Slip (...) as 1 - v/(r omega), braking r omega/v - 1, of another definition of it (...)."""
    given = np.asarray(given, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        if definition == "v/(r omega)":
            return np.where(given <= 1.0, 1.0 - given, 1.0 / given - 1.0)
        if definition == "(r omega - v)/v":
            return np.where(given > 0.0, given / (1.0 + given), given)
    return given


def along_path(sampled: list[Floats]) -> Floats:
    """Place along the way, (n,), of coordinates: on the straight line that fits them best."""
    if len(sampled) == 1:
        return sampled[0]
    points = np.stack(sampled, axis=1)
    known = np.isfinite(points).all(axis=1)
    centred = points - points[known].mean(axis=0)
    _, _, axes = np.linalg.svd(centred[known], full_matrices=False)
    place = centred @ axes[0]
    way = place[known]
    return np.asarray(place if way[-1] >= way[0] else -place)


def channel_constant(run: Run, channel: ChannelMap) -> float:
    """A channel that no column is: a value, or a number that the log or its name states."""
    if channel.value is not None:
        return channel.value.value
    if channel.head_pattern is not None:
        key, place, texts = "head", "the lines before the header of", run.about
        pattern = channel.head_pattern
    else:
        assert channel.name_pattern is not None
        key, place, texts, pattern = "file_name", "the name of", (run.name,), channel.name_pattern
    for match in filter(None, map(pattern.search, texts)):
        try:
            number = channel.scale * read_number((match[1] or "").strip().replace(",", "."))
        except ValueError:
            continue
        return float(our_slip(number, channel.definition)) if channel.role == "slip" else number
    raise InputError(
        f"{channel.where} {key} {pattern.pattern!r} finds no number in {place} the run {run.name!r}"
    )


def resting(inputs: Inputs) -> slice | None:
    """The stretch before the wheel starts, without its end; None where there is none."""
    speed = inputs.values.get("wheel_speed", inputs.values.get("rim_speed"))
    if speed is None:
        speed = inputs.values.get("ground_speed", _effort(inputs))
    if speed is None or not np.isfinite(speed).any():
        return None
    size = np.abs(speed)
    moves = np.nan_to_num(size) > max(_STANDS * float(np.nanpercentile(size, 90)), 1e-9)
    # a single noisy sample is no start
    width = max(1, round(0.1 / inputs.step))
    sustained = np.convolve(moves, np.ones(width), "full")[: moves.size] >= width
    first = int(np.argmax(sustained)) - width + 1 if sustained.any() else moves.size
    margin = _BEFORE_START + (SMOOTH / 2 if "wheel_angle" in inputs.places else 0.0)
    end = first - round(margin / inputs.step)
    return slice(0, end) if end * inputs.step >= _SHORTEST_REST else None


def moving(inputs: Inputs) -> NDArray[np.bool_]:
    """Samples (n,) in which the wheel drives; all of them where no speed is known."""
    speed = inputs.values.get("wheel_speed", inputs.values.get("rim_speed"))
    if speed is None:
        speed = inputs.values.get("ground_speed")
    if speed is None:
        return np.ones(inputs.time.size, dtype=bool)
    size: Floats = np.abs(np.nan_to_num(speed))
    return np.asarray(size > 0.3 * np.percentile(size, 90))


def _effort(inputs: Inputs) -> Floats | None:
    """Torque or current (n,) less its zero, in a log of slip without speeds that begins at rest."""
    effort = inputs.values.get("torque", inputs.values.get("motor_current"))
    first = max(3, round(_SHORTEST_REST / inputs.step))
    if effort is None or "slip" not in inputs.values or not np.isfinite(effort[:first]).any():
        return None
    zero = float(np.nanmedian(effort[:first]))
    usual = float(np.nanpercentile(np.abs(effort), 90))
    if abs(zero) >= _EFFORT * usual:
        return None  # a zero that is far off, or a wheel that drives from the beginning
    return np.where(np.abs(effort - zero) > _EFFORT * usual, effort - zero, 0.0)


def _tare(inputs: Inputs, wheel: WheelMap) -> None:
    rest = resting(inputs)
    for role, values in inputs.values.items():
        channel = wheel.channels.get(role)
        if rest is not None:
            mean, error = mean_error(values[rest], inputs.step)[:2]
            inputs.rest[role] = (mean, error)
        if channel is None or channel.tare is None:
            continue
        if channel.tare == "rest":
            if rest is None:
                text = (
                    f"[{role}] is not tared: the wheel does not rest at the start of the run; "
                    "state a stretch, such as tare = [0.5, 3.0]"
                )
                inputs.notes.append(Remark("not-tared", text, (role,)))
                continue
            stretch = values[rest]
        else:
            assert isinstance(channel.tare, tuple)
            start, stop = channel.tare
            stretch = values[(inputs.time >= start) & (inputs.time <= stop)]
        if np.isfinite(stretch).sum() < 5:
            text = f"[{role}] is not tared: the stretch has fewer than 5 samples"
            inputs.notes.append(Remark("not-tared", text, (role,)))
            continue
        zero, error = mean_error(stretch, inputs.step)[:2]
        inputs.values[role] = values - zero
        inputs.tare[role], inputs.tare_error[role] = zero, error
        if role in inputs.rest:
            inputs.rest[role] = (inputs.rest[role][0] - zero, error)
