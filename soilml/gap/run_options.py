"""Runs and checks that could be proposed, at operating points that a rig can drive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings
from soilml.physics.operating_point import AFTER_CAMPAIGN, FROM_ORDER, Operating

#: Covariates of a plain run, where nothing else is known: a slow wheel on virgin soil, straight on,
#: after the campaign, with a load cell that does not lag.
USUAL_COVARIATES: dict[str, Any] = {
    "speed": 0.05,
    "pass_number": 1.0,
    "slip_angle": 0.0,
    **AFTER_CAMPAIGN,
}

ROWS_PER_RUN, FEWEST_ROWS = 8, 3  # Rows of a proposed run, and the fewest that make a run
#: Highest slip that is proposed: near 1 a wheel digs itself in before its readings are steady.
HIGHEST_SLIP = 0.8
#: Highest speed that is proposed, m/s: no rover, and hardly a rig, drives faster.
HIGHEST_SPEED = 10.0
#: Steps of proposed slips, the first that gives enough rows: what speed control can set.
SLIP_STEPS = (0.05, 0.01)
#: Heavier loads that are tried, as multiples of the heaviest driven, until the soil carries one:
#: none above twice that load, for which the rig may not be built. The lighter load likewise.
HEAVIER, LIGHTER = (1.5, 1.25), 0.6

#: Checks of sensors and rig, and tests of the soil with a bevameter: kind -> (instruction, sizes of
#: effects and soil parameters that it measures -> their standard deviations afterwards, in their
#: units or as a share of the value). Those of soil tests are twice the usual variation of prepared
#: soil from place to place (0.5 deg of friction angle, 5 % of the bearing moduli), as a plate and a
#: ring load the soil otherwise than a wheel does; cohesion and shear modulus are read less well off
#: the curves.
CHECKS: dict[str, tuple[str, dict[str, float | str]]] = {
    "dead-weight torque": (
        "hang a known weight on a lever at the hub and read the torque sensor",
        {"torque-gain.gain": 0.003, "torque-offset.offset": 0.01},
    ),
    "weighed wheel": (
        "place the wheel on a scale and read the load sensor",
        {"load-gain.gain": 0.003, "load-transfer.ratio": 0.005},
    ),
    "lifted wheel": (
        "lift the wheel off the soil, turn it, and read all sensors",
        {
            "torque-offset.offset": 0.01,
            "bearing-friction.coefficient": 0.001,
            "drawbar-offset.offset": 0.05,
        },
    ),
    "pulled spring scale": (
        "pull the axle with a known force and read the drawbar sensor",
        {"drawbar-gain.gain": 0.003, "drawbar-offset.offset": 0.05},
    ),
    "gauge blocks": (
        "set the wheel on blocks of known height and read the sinkage sensor",
        {"sinkage-offset.offset": 0.0001, "sinkage-gain.gain": 0.003},
    ),
    "levelled bed": ("put an inclinometer on the bed", {"slope.angle": 0.001}),
    "marked wheel": (
        "roll the wheel ten turns without slip and measure the distance",
        {"slip-scale.error": 0.002},
    ),
    "towed wheel": (
        "tow the wheel, whose rolling radius is known, unpowered on hard ground and read its slip",
        {"slip-offset.offset": 0.002},
    ),
    "measured lugs": (
        "measure height and spacing of the lugs",
        {"grousers.height": 0.001, "track-grousers.spacing": 0.05},
    ),
    "plate test": (
        "press plates of two widths into the soil and fit pressure against sinkage",
        {"kc": "10 %", "kphi": "10 %", "n": 0.05},
    ),
    "shear test": (
        "turn a shear ring on the soil under three normal stresses and fit stress against "
        "displacement",
        {
            "cohesion": 200.0,
            "friction_angle": float(np.deg2rad(1.0)),
            "shear_modulus": "20 %",
        },
    ),
}


@dataclass(frozen=True)
class RunOption:
    """A possible run: its kind, a description, and its operating points.

    `plain` are the same slips and loads at usual covariates, where the run differs by one: the run
    adds more than a repeat only if some model predicts other readings for it.
    """

    kind: str
    text: str
    at: Operating
    plain: Operating | None = None


def run_options(readings: Readings, case: Case) -> Iterator[RunOption]:
    """Runs that differ from those driven, at rows that the soil of the case carries."""
    at, loads, slips = readings.at, readings.row_load, readings.row_slip
    least, highest = float(slips.min()), float(slips.max())
    covariates = _usual(readings)
    usual = drivable_slips(least, highest)
    if usual.size < FEWEST_ROWS:
        usual = drivable_slips(0.05, 0.6)
    gears = list(case.gears) or [""]

    def points(slip: Floats, load: float, gear: str, **own: float) -> Operating:
        given: dict[str, Any] = {"load": load, **covariates, **own}
        given |= {"gear": gear} if gear else {}
        return Operating(slip=slip, **{k: np.full(slip.size, v) for k, v in given.items()})

    def runs(kind: str, text: str, slip: Floats, load: float, **own: float) -> Iterator[RunOption]:
        for gear in gears:
            what = f"{text} under {load:g} N" + (f", with the gear {gear}" if gear else "")
            kept = slip[carried_rows(case, points(slip, load, gear, **own))]
            if kept.size >= FEWEST_ROWS:
                plain = points(kept, load, gear) if own else None
                yield RunOption(kind, what, points(kept, load, gear, **own), plain)

    heavier = [_whole(factor * float(loads.max())) for factor in HEAVIER]
    carried = (w for w in heavier if carried_rows(case, points(usual, w, gears[0])).all())
    yield from runs("heavier", "the same slips", usual, next(carried, heavier[-1]))
    yield from runs("lighter", "the same slips", usual, _whole(LIGHTER * float(loads.min())))
    levels, log_load = readings.load_levels, np.log(readings.load)
    centres = np.asarray([np.median(log_load[levels.index == i]) for i in range(levels.count)])
    # the driven load level that is closest to the mean in logarithms
    middle = _whole(float(np.exp(centres[np.argmin(np.abs(centres - np.mean(log_load)))])))
    if highest <= HIGHEST_SLIP - 0.1:
        high = drivable_slips(highest, highest + 0.3)
        yield from runs("higher slip", f"slips up to {high.max():g}", high, middle)
    yield from runs("low slip", "slips close to zero", drivable_slips(0.01, 0.12), middle)
    if least >= 0.0:
        yield from runs("braking", "a braked wheel", drivable_slips(-0.4, -0.05), middle)
    pace = covariates.get("speed", 0.0) or USUAL_COVARIATES["speed"]
    if at.speed is None or float(np.min(at.speed)) >= 0.0:
        yield from runs("reverse", "the same slips in reverse", usual, middle, speed=-pace)
    if _unvaried(at.speed):
        faster = 10.0 * abs(pace) <= HIGHEST_SPEED
        other = (10.0 if faster else 0.1) * pace
        text = f"the same slips {'ten times' if faster else 'a tenth'} as fast, at {other:.2g} m/s,"
        yield from runs("other speed", text, usual, middle, speed=other)
    if _unvaried(at.pass_number):
        text = "the same slips again in the same rut"
        yield from runs("second pass", text, usual, middle, pass_number=2.0)
    if _unvaried(at.slip_angle):
        text = "the wheel at a slip angle of 0.2 rad"
        yield from runs("slip angle", text, usual, middle, slip_angle=0.2)


def drivable_slips(low: float, high: float) -> Floats:
    """At most `ROWS_PER_RUN` slips between two, in steps that a rig can set."""
    low, high = max(low, -HIGHEST_SLIP), min(high, HIGHEST_SLIP)
    for step in SLIP_STEPS:
        first, last = round(low / step), round(high / step)
        if last - first + 1 >= ROWS_PER_RUN:
            break
    grid = np.arange(first, last + 1)
    count = min(ROWS_PER_RUN, grid.size)
    chosen = grid[np.linspace(0, grid.size - 1, count).round().astype(int)] if count else grid
    return np.asarray(np.round(chosen * step, 2))


def _whole(load: float) -> float:
    """A load in whole newton; below 10 N in two digits."""
    step = min(1.0, 10.0 ** (np.floor(np.log10(load)) - 1.0))
    return float(np.round(np.round(load / step) * step, 9))


def _usual(readings: Readings) -> dict[str, Any]:
    """The covariates of a plain run as most rows were driven, forward and on the first pass."""
    usual = {}
    for field in USUAL_COVARIATES:
        value = None if field in FROM_ORDER else getattr(readings.at, field)
        if value is None:
            continue
        typical = np.median(np.abs(value) if field == "speed" else value)
        if field == "pass_number":
            typical = np.min(value)
        usual[field] = float(f"{typical:.2g}")  # what a rig can be set to
    return usual


def _unvaried(value: object) -> bool:
    return value is None or float(np.ptp(np.asarray(value))) == 0.0


def carried_rows(case: Case, at: Operating) -> NDArray[np.bool_]:
    """Rows (n,) at which the model finds an equilibrium: the soil carries the load."""
    status = forces(case, with_default_covariates(at, case)).status
    return np.broadcast_to(np.asarray(status) == 0, np.shape(at.slip))


def with_default_covariates(at: Operating, case: Case) -> Operating:
    """The operating points with default values of covariates that the case's effects need."""
    models = (case.model, *case.gears.values())
    needs = {field for m in models for effect in m.effects for field in effect.about.needs}
    missing = {f: USUAL_COVARIATES[f] for f in needs if getattr(at, f) is None}
    return replace(at, **missing) if missing else at
