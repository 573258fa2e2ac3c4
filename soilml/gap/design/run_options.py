"""Runs that could be proposed, at operating points that a rig can drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.readings import Readings
from soilml.gap.design.planned_readings import USUAL_COVARIATES, carried_rows
from soilml.parameters import declared
from soilml.physics.effects.base import Effect
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


@dataclass(frozen=True)
class RunOption:
    """A possible run: its kind, a description, its operating points and the gear it needs.

    `plain` are the same slips and loads at usual covariates, where the run differs by one:
    the run adds more than a repeat only if some model predicts other readings for it.
    """

    kind: str
    text: str
    at: Operating
    plain: Operating | None = None
    gear: GearChange | None = None

    def changed(self, case: Case) -> Case:
        """The case with the gear of this run."""
        return case if self.gear is None else self.gear.apply(case)


def run_options(
    readings: Readings, case: Case, effects: Sequence[type[Effect]]
) -> Iterator[RunOption]:
    """Runs that differ from those driven, at rows that the soil of the case carries.

    `effects` are those that the runs are to distinguish: a change of the gear is proposed where
    one of them depends on it.
    """
    loads = np.asarray(readings.at.load, dtype=np.float64)
    slips = np.asarray(readings.at.slip, dtype=np.float64)
    middle, highest = _middle_load(readings), float(slips.max())
    usual = drivable_slips(float(slips.min()), highest)
    if usual.size < FEWEST_ROWS:
        usual = drivable_slips(0.05, 0.6)

    def run(kind: str, text: str, slip: Floats, load: float, **covariates: float) -> RunOption:
        plain = Operating(slip=slip, load=np.full(slip.size, load), **_usual(readings))
        if not covariates:
            return RunOption(kind, f"{text} under {load:g} N", plain)
        own: dict[str, Any] = {name: np.full(slip.size, v) for name, v in covariates.items()}
        return RunOption(kind, f"{text} under {load:g} N", replace(plain, **own), plain)

    heavier = [
        run("heavier", "the same slips", usual, _whole(factor * float(loads.max())))
        for factor in HEAVIER
    ]
    lighter = run("lighter", "the same slips", usual, _whole(LIGHTER * float(loads.min())))
    options = [
        next((option for option in heavier if carried_rows(case, option.at).all()), heavier[-1]),
        lighter,
    ]
    if highest <= HIGHEST_SLIP - 0.1:
        high = drivable_slips(highest, highest + 0.3)
        options.append(run("higher slip", f"slips up to {high.max():g}", high, middle))
    low = drivable_slips(0.01, 0.12)
    options.append(run("low slip", "slips close to zero", low, middle))
    if float(slips.min()) >= 0.0:
        options.append(run("braking", "a braked wheel", drivable_slips(-0.4, -0.05), middle))
    speed = readings.at.speed
    pace = _usual(readings).get("speed", 0.0) or USUAL_COVARIATES["speed"]
    if speed is None or float(np.min(speed)) >= 0.0:
        options.append(run("reverse", "the same slips in reverse", usual, middle, speed=-pace))
    if _unvaried(speed):
        faster = 10.0 * abs(pace) <= HIGHEST_SPEED
        other = (10.0 if faster else 0.1) * pace
        text = f"the same slips {'ten times' if faster else 'a tenth'} as fast, at {other:.2g} m/s,"
        options.append(run("other speed", text, usual, middle, speed=other))
    if _unvaried(readings.at.pass_number):
        text = "the same slips again in the same rut"
        options.append(run("second pass", text, usual, middle, pass_number=2.0))
    if _unvaried(readings.at.slip_angle):
        text = "the wheel at a slip angle of 0.2 rad"
        options.append(run("slip angle", text, usual, middle, slip_angle=0.2))
    for change in gear_changes(case, effects):
        option = run(change.kind, f"the same slips with {change.text}", usual, middle)
        options.append(replace(option, gear=change))
    for option in _with_each_gear(options, case):
        carried = carried_rows(option.changed(case), option.at)
        if carried.sum() >= FEWEST_ROWS:
            plain = None if option.plain is None else _selected(option.plain, carried)
            at = _selected(option.at, carried)
            text = option.text.format(highest=np.max(at.slip))
            yield replace(option, text=text, at=at, plain=plain)


def _with_each_gear(options: Sequence[RunOption], case: Case) -> Iterator[RunOption]:
    """The runs, each with each gear of a case with several."""
    if not case.gears:
        yield from options
    for option, name in product(options, case.gears):
        gear = np.full(np.shape(option.at.slip), name)
        plain = None if option.plain is None else replace(option.plain, gear=gear)
        text = f"{option.text}, with the gear {name}"
        yield replace(option, text=text, at=replace(option.at, gear=gear), plain=plain)


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


def _middle_load(readings: Readings) -> float:
    """The driven load level that is closest to the mean in logarithms, N."""
    levels = readings.load_levels
    log_load = np.log(readings.load)
    centres = np.asarray([np.median(log_load[levels.index == i]) for i in range(levels.count)])
    return _whole(float(np.exp(centres[np.argmin(np.abs(centres - np.mean(log_load)))])))


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


#: Effects of lugs, which a smooth gear does not have.
LUG_EFFECTS = frozenset({"grousers", "track-grousers"})
SMOOTH_GEAR = "smooth gear"  # Kind of a run on such a gear
#: Another size of the gear: kind of run -> (parameter, factor, effects that this separates). Half
#: as wide or half as large again: other wheels of a small rig, whose effect exceeds the noise.
SIZES = {
    "narrower gear": ("width", 0.5, frozenset({"sidewall-shear", "wheel-flexibility"})),
    "larger wheel": ("radius", 1.5, frozenset({"small-wheel-stiffness", "stress-shift"})),
}


@dataclass(frozen=True)
class GearChange:
    """Another gear for a run: a smooth one, or one of another size (m)."""

    kind: str
    text: str
    parameter: str = ""
    size: float = 0.0

    def apply(self, case: Case) -> Case:
        """The case with this gear."""
        if self.parameter:
            return case.with_values({f"gear.{self.parameter}": self.size})
        effects = tuple(e for e in case.model.effects if e.name not in LUG_EFFECTS)
        return replace(case, model=replace(case.model, effects=effects))

    @property
    def removed(self) -> frozenset[str]:
        """Names of the effects that this gear does not have."""
        return frozenset() if self.parameter else LUG_EFFECTS

    def columns(self) -> dict[str, float]:
        """The change as columns of a table."""
        if self.parameter:
            return {f"wheel_{self.parameter}_m": self.size}
        return {"grouser_height_m": 0.0}


def gear_changes(case: Case, effects: Sequence[type[Effect]]) -> Iterator[GearChange]:
    """The changes of the gear that separate some of these effects from others.

    None where a case has several gears: it is those that are there to drive.
    """
    if case.gears:
        return
    names = {effect.name for effect in effects}
    if names & LUG_EFFECTS:
        yield GearChange(SMOOTH_GEAR, "lugs removed or covered")
    sizes = declared(type(case.model.gear))
    for kind, (parameter, factor, separated) in SIZES.items():
        if names & separated and parameter in sizes:
            size = float(f"{factor * float(getattr(case.model.gear, parameter)):.2g}")
            text = f"a {parameter} of {size:g} m"
            yield GearChange(kind, text, parameter, size)
