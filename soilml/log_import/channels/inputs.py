"""The channels of one wheel on one grid, in the units of soilml, tared."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.cell_text import read_number
from soilml.log_import.channels.resampling import (
    MOST_POINTS,
    SHORTEST_STEP,
    derivative,
    on_grid,
    sampling_interval,
    unwrapped,
)
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.wheel_quantities import slope_of
from soilml.log_import.mapping.channel_map import ChannelMap
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.windows.mean_errors import mean_error
from soilml.remarks import Remark

SMOOTH = 0.5  # Span of the derivative of places and angles, s
#: Share of the usual rotation speed below which a wheel stands still; shortest rest, and what is
#: left out before the start, s.
_STANDS, _SHORTEST_REST, _BEFORE_START = 0.05, 0.4, 0.2
#: Roles that are places, and the role of their rate.
_PLACES = {"wheel_angle": "wheel_speed", "position": "ground_speed"}
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
    constants: dict[str, float] = field(default_factory=dict)  # Roles that do not vary
    # Mean at rest and its standard error by role; empty where the wheel never rests
    rest: dict[str, tuple[float, float]] = field(default_factory=dict)
    tare: dict[str, float] = field(default_factory=dict)  # What was subtracted by role
    tare_error: dict[str, float] = field(default_factory=dict)  # Standard error of the tare by role
    notes: list[Remark] = field(default_factory=list)  # What was tared, and what could not be

    @property
    def step(self) -> float:
        """Step of the grid, s."""
        return float(self.time[1] - self.time[0])

    @property
    def speed(self) -> Floats | None:
        """The first speed that is known (n,): rotation, rim, travel."""
        known = ("wheel_speed", "rim_speed", "ground_speed")
        return next((self.values[role] for role in known if role in self.values), None)

    @property
    def motion(self) -> Floats | None:
        """What is zero where the wheel rests (n,): the speed, else torque or current less its zero.

        The zero is that of a log that begins at rest.
        """
        if self.speed is not None and np.isfinite(self.speed).any():
            return self.speed
        effort = self.values.get("torque", self.values.get("motor_current"))
        first = max(3, round(_SHORTEST_REST / self.step))
        of_slip = "slip" in self.values or "slip" in self.constants
        if effort is None or not of_slip or not np.isfinite(effort[:first]).any():
            return None
        zero = float(np.nanmedian(effort[:first]))
        usual = float(np.nanpercentile(np.abs(effort), 90))
        moved = effort - (zero if abs(zero) < _EFFORT * usual else 0.0)
        return np.where(np.abs(moved) > _EFFORT * usual, moved, 0.0)

    def within(self, start: float, stop: float) -> NDArray[np.bool_]:
        """Samples (n,) of a stretch."""
        return np.asarray((self.time >= start) & (self.time <= stop))


def wheel_inputs(run: Run, wheel: WheelMap) -> Inputs:
    """The channels of a wheel in a run.

    Raises `InputError` for a column that the run lacks, and where channels do not overlap in time.
    """
    channels = wheel.channels.items()
    raw = {role: [run.find(a) for a in channel.columns] for role, channel in channels
           if channel.columns}  # fmt: skip
    constants = {role: channel_constant(run, channel) for role, channel in channels
                 if not channel.columns}  # fmt: skip
    parts = [part for several in raw.values() for part in several]
    if not parts:
        raise InputError(f"run {run.name}: the map names no column")
    intervals = [sampling_interval(times, values) for times, values in parts]
    if not np.isfinite(min(intervals)):
        raise InputError(f"run {run.name}: no channel has two samples with a time")
    start, stop = max(times[0] for times, _ in parts), min(times[-1] for times, _ in parts)
    if not start < stop:
        raise InputError(
            f"run {run.name}: the recordings do not overlap in time ({start:.6g} s to {stop:.6g} "
            "s); where their clocks differ, write clock = 'start' in [files]"
        )
    # the step of the finest channel, within limits
    step = max(min(intervals), SHORTEST_STEP, (stop - start) / MOST_POINTS)
    grid: Floats = start + step * np.arange(int((stop - start) / step) + 1, dtype=np.float64)
    if grid.size < 8:
        raise InputError(f"run {run.name} has {grid.size} samples; needed are 8 or more")
    inputs = Inputs(grid, constants=constants)
    for role, several in raw.items():
        channel = wheel.channels[role]
        if channel.unwrap:
            several = [(t, unwrapped(v, channel.unwrap)) for t, v in several]
        rate = _PLACES.get(role)
        sampled = [on_grid(grid, t, v, continuous=rate is not None) for t, v in several]
        if rate is None:
            inputs.values[role] = combined(channel, sampled)
        else:  # places are added with their rate
            place = channel.scale * along_path(sampled)
            inputs.intervals[role] = max(sampling_interval(t, v) for t, v in several)
            inputs.places[role] = place
            inputs.values.setdefault(rate, derivative(grid, place, SMOOTH))
    _tare(inputs, wheel)
    return inputs


def combined(channel: ChannelMap, columns: list[Floats]) -> Floats:
    """A channel (n,) in the unit of soilml, of its columns (n,).

    Cells that carry the wheel together add up, sensors of one sinkage are averaged.
    """
    if channel.role == "slope":
        return channel.scale * slope_of(columns)
    total = channel.scale * sum(columns[1:], start=columns[0])
    if channel.role == "slip":
        total = our_slip(total, channel.definition)
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
    key, place, texts = "head", "the lines before the header of", run.about
    pattern = channel.head_pattern
    if pattern is None:
        key, place, texts, pattern = "file_name", "the name of", (run.name,), channel.name_pattern
    assert pattern is not None
    for match in filter(None, map(pattern.search, texts)):
        with suppress(ValueError):
            number = channel.scale * read_number((match[1] or "").strip().replace(",", "."))
            return float(our_slip(number, channel.definition)) if channel.role == "slip" else number
    raise InputError(
        f"{channel.where} {key} {pattern.pattern!r} finds no number in {place} the run {run.name!r}"
    )


def resting(inputs: Inputs) -> slice | None:
    """The stretch before the wheel starts, without its end; None where there is none."""
    if inputs.motion is None:
        return None
    size = np.abs(inputs.motion)
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
    if inputs.speed is None:
        return np.ones(inputs.time.size, dtype=bool)
    size: Floats = np.abs(np.nan_to_num(inputs.speed))
    return np.asarray(size > 0.3 * np.percentile(size, 90))


def _tare(inputs: Inputs, wheel: WheelMap) -> None:
    rest = resting(inputs)
    for role, values in inputs.values.items():
        if rest is not None:
            inputs.rest[role] = mean_error(values[rest], inputs.step)[:2]
        tare = wheel.channels[role].tare if role in wheel.channels else None
        if tare is None:
            continue
        stretch = values[:0] if rest is None else values[rest]
        if isinstance(tare, tuple):
            stretch = values[inputs.within(*tare)]
        if np.isfinite(stretch).sum() < 5:
            why = "the stretch has fewer than 5 samples"
            if tare == "rest" and rest is None:
                why = (
                    "the wheel does not rest at the start of the run; state a stretch, such as "
                    "tare = [0.5, 3.0]"
                )
            text = f"[{role}] is not tared: {why}"
            inputs.notes.append(Remark("not-tared", text, (role,)))
            continue
        zero, error = mean_error(stretch, inputs.step)[:2]
        inputs.values[role] = values - zero
        inputs.tare[role], inputs.tare_error[role] = zero, error
        if role in inputs.rest:
            inputs.rest[role] = (inputs.rest[role][0] - zero, error)
