"""Runs and checks that could be proposed, at operating points that a rig can drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.readings import Readings
from soilml.gap.planned_readings import USUAL_COVARIATES, carried_rows
from soilml.gap.results import NextRun
from soilml.physics.operating_point import FROM_ORDER, Operating

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
#: Effects of lugs, which a smooth gear does not have, and the kind of a run on such a gear.
LUG_EFFECTS, SMOOTH_GEAR = frozenset({"grousers", "track-grousers"}), "smooth gear"

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
    "towed wheel": (
        "tow the wheel, whose rolling radius is known, unpowered on hard ground and read its slip",
        {"slip-offset": 0.002},
    ),
}

#: Tests of the soil with a bevameter: kind -> (instruction, soil parameter -> standard deviation
#: after the test, whether that is relative). Twice the usual variation of prepared soil from place
#: to place (0.5 deg of friction angle, 5 % of the bearing moduli), as a plate and a ring load the
#: soil otherwise than a wheel does; cohesion and shear modulus are read less well off the curves.
SOIL_TESTS: dict[str, tuple[str, dict[str, tuple[float, bool]]]] = {
    "plate test": (
        "press plates of two widths into the soil and fit pressure against sinkage",
        {"kc": (0.1, True), "kphi": (0.1, True), "n": (0.05, False)},
    ),
    "shear test": (
        "turn a shear ring on the soil under three normal stresses and fit stress against "
        "displacement",
        {
            "cohesion": (200.0, False),
            "friction_angle": (float(np.deg2rad(1.0)), False),
            "shear_modulus": (0.2, True),
        },
    ),
}
#: Kinds of runs on the present gear, and all kinds of runs and checks that can be proposed.
DRIVEN = (
    *("heavier", "lighter", "higher slip", "low slip", "braking"),
    *("reverse", "other speed", "second pass", "slip angle"),
)
KINDS = (*DRIVEN, SMOOTH_GEAR, *SOIL_TESTS, *SENSOR_CHECKS)
LISTED = 8  # Proposals that are listed


@dataclass(frozen=True)
class RunOption:
    """A possible run: its kind, a description, and its operating points.

    `plain` are the same slips and loads at usual covariates, where the run differs by one: the run
    adds more than a repeat only if some model predicts other readings for it. `smooth` asks for a
    gear without lugs.
    """

    kind: str
    text: str
    at: Operating
    plain: Operating | None = None
    smooth: bool = False

    def changed(self, case: Case) -> Case:
        """The case with the gear of this run."""
        if not self.smooth:
            return case
        effects = tuple(e for e in case.model.effects if e.name not in LUG_EFFECTS)
        return replace(case, model=replace(case.model, effects=effects))


def run_options(readings: Readings, case: Case, effects: Sequence[str]) -> Iterator[RunOption]:
    """Runs that differ from those driven, at rows that the soil of the case carries.

    `effects` are the names of those that the runs are to distinguish: a smooth gear is proposed
    where one of them is of lugs, and the case has one gear.
    """
    loads, slips = readings.row_load, readings.row_slip
    least, highest = float(slips.min()), float(slips.max())
    covariates = _usual(readings)
    usual = drivable_slips(least, highest)
    if usual.size < FEWEST_ROWS:
        usual = drivable_slips(0.05, 0.6)

    def run(kind: str, text: str, slip: Floats, load: float, **own: float) -> RunOption:
        plain = Operating(slip=slip, load=np.full(slip.size, load), **covariates)
        given: dict[str, Any] = {name: np.full(slip.size, v) for name, v in own.items()}
        return RunOption(
            kind, f"{text} under {load:g} N", replace(plain, **given), plain if own else None
        )

    heavier = [
        run("heavier", "the same slips", usual, _whole(factor * float(loads.max())))
        for factor in HEAVIER
    ]
    carried = (option for option in heavier if carried_rows(case, option.at).all())
    options = [next(carried, heavier[-1])]
    lightest = _whole(LIGHTER * float(loads.min()))
    options.append(run("lighter", "the same slips", usual, lightest))
    levels, log_load = readings.load_levels, np.log(readings.load)
    centres = np.asarray([np.median(log_load[levels.index == i]) for i in range(levels.count)])
    # the driven load level that is closest to the mean in logarithms
    middle = _whole(float(np.exp(centres[np.argmin(np.abs(centres - np.mean(log_load)))])))
    if highest <= HIGHEST_SLIP - 0.1:
        high = drivable_slips(highest, highest + 0.3)
        options.append(run("higher slip", f"slips up to {high.max():g}", high, middle))
    options.append(run("low slip", "slips close to zero", drivable_slips(0.01, 0.12), middle))
    if least >= 0.0:
        options.append(run("braking", "a braked wheel", drivable_slips(-0.4, -0.05), middle))
    at = readings.at
    pace = covariates.get("speed", 0.0) or USUAL_COVARIATES["speed"]
    if at.speed is None or float(np.min(at.speed)) >= 0.0:
        options.append(run("reverse", "the same slips in reverse", usual, middle, speed=-pace))
    if _unvaried(at.speed):
        faster = 10.0 * abs(pace) <= HIGHEST_SPEED
        other = (10.0 if faster else 0.1) * pace
        text = f"the same slips {'ten times' if faster else 'a tenth'} as fast, at {other:.2g} m/s,"
        options.append(run("other speed", text, usual, middle, speed=other))
    if _unvaried(at.pass_number):
        text = "the same slips again in the same rut"
        options.append(run("second pass", text, usual, middle, pass_number=2.0))
    if _unvaried(at.slip_angle):
        text = "the wheel at a slip angle of 0.2 rad"
        options.append(run("slip angle", text, usual, middle, slip_angle=0.2))
    if LUG_EFFECTS.intersection(effects) and not case.gears:
        text = "the same slips with lugs removed or covered"
        options.append(replace(run(SMOOTH_GEAR, text, usual, middle), smooth=True))
    for option in options:
        for name in case.gears or ("",):
            own = _on_gear(option, name) if name else option
            carries = carried_rows(own.changed(case), own.at)
            if carries.sum() >= FEWEST_ROWS:
                plain = None if own.plain is None else _selected(own.plain, carries)
                yield replace(own, at=_selected(own.at, carries), plain=plain)


def _on_gear(option: RunOption, name: str) -> RunOption:
    """The run with one of several gears."""
    gear = np.full(np.shape(option.at.slip), name)
    plain = None if option.plain is None else replace(option.plain, gear=gear)
    text = f"{option.text}, with the gear {name}"
    return replace(option, text=text, at=replace(option.at, gear=gear), plain=plain)


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


def _selected(at: Operating, kept: NDArray[np.bool_]) -> Operating:
    """Some of the rows (n,) of operating points."""
    given = {f.name: getattr(at, f.name) for f in fields(at)}
    known = {k: np.broadcast_to(v, kept.shape)[kept] for k, v in given.items() if v is not None}
    return Operating(**known)


def _unvaried(value: object) -> bool:
    return value is None or float(np.ptp(np.asarray(value))) == 0.0


def check_costs(costs: Mapping[str, float]) -> dict[str, float]:
    """Costs by the names of `KINDS`; raises `InputError` for another kind or no positive number.

    In a name given here, hyphens and spaces are the same: ``second-pass``.
    """
    names = {kind.replace("-", " "): kind for kind in KINDS}
    checked = {}
    for given, cost in costs.items():
        kind = names.get(given.replace("-", " "))
        if kind is None:
            known = ", ".join(name.replace(" ", "-") for name in names)
            raise InputError(f"cost of {given!r}: no such kind of run; there are: {known}")
        if not (math.isfinite(cost) and cost > 0.0):
            raise InputError(f"cost of {given!r} is {cost:g}; needed is a number above zero")
        checked[kind] = float(cost)
    return checked


def rank_by_cost(runs: Sequence[NextRun], costs: Mapping[str, float]) -> list[NextRun]:
    """The most useful runs: by discrimination, or by discrimination per cost where costs are given.

    A kind without cost costs 1.
    """
    if costs:
        runs = [replace(run, cost=costs.get(run.kind, 1.0)) for run in runs]
    return sorted(runs, key=lambda run: -run.discrimination / (run.cost or 1.0))[:LISTED]
