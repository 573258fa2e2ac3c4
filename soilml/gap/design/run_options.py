"""Runs and sensor checks that could be proposed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Rows of a proposed run.
ROWS_PER_RUN = 8


@dataclass(frozen=True)
class RunOption:
    """A possible run: its kind, a description, and its operating points."""

    kind: str
    text: str
    at: Operating


#: Checks of sensors and rig: kind -> (instruction, effect -> standard deviation of its size after
#: the check, in the unit of the size).
SENSOR_CHECKS: dict[str, tuple[str, dict[str, float]]] = {
    "dead-weight torque": (
        "hang a known weight on a lever at the hub and read the torque sensor",
        {"torque-gain": 0.003, "torque-offset": 0.01},
    ),
    "weighed wheel": (
        "place the wheel on a scale and read the load sensor",
        {"load-gain": 0.003, "load-transfer": 0.005},
    ),
    "lifted wheel": (
        "lift the wheel off the soil, turn it, and read all sensors",
        {"torque-offset": 0.01, "bearing-friction": 0.001, "drawbar-offset": 0.05},
    ),
    "pulled spring scale": (
        "pull the axle with a known force and read the drawbar sensor",
        {"drawbar-gain": 0.003, "drawbar-offset": 0.05},
    ),
    "gauge blocks": (
        "set the wheel on blocks of known height and read the sinkage sensor",
        {"sinkage-offset": 0.0001, "sinkage-gain": 0.003},
    ),
    "levelled bed": ("put an inclinometer on the bed", {"slope": 0.001}),
    "marked wheel": (
        "roll the wheel ten turns without slip and measure the distance",
        {"slip-scale": 0.002},
    ),
}


def run_options(readings: StackedReadings) -> Iterator[RunOption]:
    """Runs at operating points that the data do not cover."""
    loads = np.asarray(readings.at.load, dtype=np.float64)
    slips = np.asarray(readings.at.slip, dtype=np.float64)
    low, high = float(loads.min()), float(loads.max())
    middle = float(np.exp(np.mean(np.log(loads))))
    usual = np.linspace(float(slips.min()), float(slips.max()), ROWS_PER_RUN)
    if np.ptp(usual) < 0.1:
        usual = np.linspace(0.05, 0.6, ROWS_PER_RUN)
    yield _run("heavier", f"the same slips under {1.5 * high:.3g} N", usual, 1.5 * high)
    yield _run("lighter", f"the same slips under {0.6 * low:.3g} N", usual, 0.6 * low)
    most = min(0.9, float(slips.max()) + 0.3, MOST_SLIP)
    yield _run(
        "higher slip", f"slips up to {most:.2g}", np.linspace(0.2, most, ROWS_PER_RUN), middle
    )
    yield _run("low slip", "slips close to zero", np.linspace(0.01, 0.12, ROWS_PER_RUN), middle)
    if float(slips.min()) >= 0.0:
        yield _run("braking", "a braked wheel", np.linspace(-0.4, -0.05, ROWS_PER_RUN), middle)
    reverse = _run("reverse", "the same run in reverse", usual, middle)
    yield replace(reverse, at=replace(reverse.at, speed=-0.05 + 0.0 * usual))
    if _unvaried(readings.at.speed):
        fast = _run("other speed", "the same run ten times as fast", usual, middle)
        speed = (
            0.5 if readings.at.speed is None else 10.0 * float(np.max(np.abs(readings.at.speed)))
        )
        yield replace(fast, at=replace(fast.at, speed=speed + 0.0 * usual))
    if _unvaried(readings.at.pass_number):
        again = _run("second pass", "the same run again in the same rut", usual, middle)
        yield replace(again, at=replace(again.at, pass_number=2.0 + 0.0 * usual))
    if _unvaried(readings.at.slip_angle):
        skew = _run("slip angle", "the wheel at a slip angle of 0.2 rad", usual, middle)
        yield replace(skew, at=replace(skew.at, slip_angle=0.2 + 0.0 * usual))


def _run(kind: str, text: str, slips: Floats, load: float) -> RunOption:
    return RunOption(kind, text, Operating(slip=slips, load=np.full(slips.size, load)))


def _unvaried(value: object) -> bool:
    return value is None or float(np.ptp(np.asarray(value))) == 0.0


def expected_readings(option: RunOption, like: StackedReadings, case: Case) -> StackedReadings:
    """The readings that a case expects of a run, in the channels and with the noise of `like`."""
    rows, channels = np.asarray(option.at.slip).size, len(like.channels)
    row = np.tile(np.arange(rows), channels)
    channel = np.repeat(np.arange(channels), rows)
    force = case.model(case.soil, with_default_covariates(option.at, case))
    expected = np.stack([getattr(force, name) for name in like.channels], axis=-1)
    reading = expected[row, channel]
    std = np.empty(row.size)
    for i, name in enumerate(like.channels):
        in_channel = channel == i
        noise = like.noise[i] or case.noise.get(column(name))
        present = like.std[like.channel == i]
        typical = float(np.median(present)) if present.size else np.nan
        std[in_channel] = typical if noise is None else noise.std(reading[in_channel])
    return StackedReadings(
        at=with_default_covariates(option.at, case),
        run=np.zeros(rows, dtype=np.int64),
        runs=(option.kind,),
        order=np.arange(rows),
        channels=like.channels,
        row=row,
        channel=channel,
        reading=reading,
        std=np.maximum(std, 1e-12),
        noise=like.noise,
    )


def with_default_covariates(at: Operating, case: Case) -> Operating:
    """The operating points with default values of covariates that the case's effects need."""
    usual = {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
    needs = {field for effect in case.model.effects for field in effect.about.needs}
    missing = {f: usual[f] for f in needs if getattr(at, f) is None}
    return replace(at, **missing) if missing else at
