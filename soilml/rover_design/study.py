"""A question about a rover's design, as a file asks it: rover, wheel, soil, goal."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.model_settings import take_soil
from soilml.config.wheeled_rover import GravityByName, RoverWheel, WheeledRover
from soilml.errors import InputError
from soilml.io.declared_settings import Numbers, OneOf, in_si, take_declared
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter
from soilml.physics.soils import SoilEntry, soil_catalogue
from soilml.physics.soils.catalogue import Soil, soil
from soilml.physics.soils.soil_tests import SoilTest

#: What a design consists of, in the order of all tables, and the bounds of each.
DIMENSIONS = {
    "radius": Parameter("m", 0.005, 2.0, "radius of the rim"),
    "width": Parameter("m", 0.005, 2.0, "width of a wheel"),
    "lug_height": Parameter("m", 0.0, 0.2, "height of a lug above the rim"),
    "wheels": Parameter("1", 4, 40, "wheels, all driven, in pairs"),
    "mass": Parameter("kg", 0.01, 1e5, "mass of the whole rover"),
}
#: What a goal may ask to be least among the designs that meet it.
LEAST = ("energy", "torque", *DIMENSIONS)
SLIP_LIMIT, RISK = 0.6, 0.05  # Defaults: those of `pull` and of its 90 % bands


@dataclass(frozen=True)
class Dimension:
    """A dimension of a design: some values (m,), or all between two of them (`searched`).

    step: Between the values of a range; 0 for any.
    """

    values: tuple[float, ...]
    searched: bool = False
    step: int = 0

    @property
    def varied(self) -> bool:
        """Whether there is more than one design by it."""
        return len(self.values) > 1

    def at(self, fraction: Floats) -> Floats:
        """Values at fractions (k,) from 0 to 1 of the range, or of the list."""
        low, high = self.values[0], self.values[-1]
        if self.searched and not self.step:
            return np.asarray(low + (high - low) * fraction)
        values: Floats = np.asarray(self.values, dtype=np.float64)
        if self.searched:
            values = np.arange(low, high + 0.5, self.step)
        index = np.minimum((fraction * len(values)).astype(int), len(values) - 1)
        return np.asarray(values[index])


class OpenSize:
    """A number, a range [lower, upper], or { values = [...] }; texts may have a unit."""

    def take(self, settings: Settings, key: str, kind: str) -> Dimension:
        """The values of one of `DIMENSIONS`."""
        bounds = DIMENSIONS[key]
        unit = f" in {bounds.unit}" if bounds.unit != "1" else ""
        needed = f"a number{unit}, a range [lower, upper], or {{ values = [...] }} ({bounds.text})"
        given = settings.take(key, (int, float, str, list, dict), needed)
        searched = isinstance(given, list)
        listed = given.get("values") if isinstance(given, dict) else given
        listed = listed if isinstance(listed, list) else [listed]
        wrong = isinstance(given, dict) and given.keys() != {"values"}
        if wrong or not listed or not all(map(_is_size, listed)):
            settings.fail(f"{key} is {given!r}; needed is {needed}")
        numbers = [in_si(settings, key, v, bounds.unit) for v in listed]
        if searched and not (len(numbers) == 2 and numbers[0] < numbers[1]):
            settings.fail(f"{key} is {listed!r}; needed is {needed}, with lower below upper")
        for value in numbers:
            if not bounds.lower <= value <= bounds.upper:
                settings.fail(
                    f"{key} is {value:g}{unit.removeprefix(' in')}; needed is {bounds.lower:g} to "
                    f"{bounds.upper:g}"
                )
            if key == "wheels" and value % 2 != 0.0:
                settings.fail(
                    f"{key} is {value:g}; needed is an even number, since wheels stand in pairs"
                )
        values = tuple(numbers if searched else sorted(set(numbers)))
        return Dimension(values, searched, 2 if key == "wheels" else 0)


def _is_size(value: Any) -> bool:
    return isinstance(value, int | float | str) and not isinstance(value, bool)


@dataclass(frozen=True)
class _RoverTable:
    """The table [rover] of a question."""

    mass: Annotated[Dimension, OpenSize()]
    wheels: Annotated[Dimension, OpenSize()]
    wheelbase: Annotated[float, Parameter("m", 0.001, 100.0, "from the first axle to the last")]
    centre_of_mass: Annotated[
        tuple[float, float],
        Numbers("[ahead of the middle, above the ground] in m, up to 100", 2, -100, 100),
    ]
    gravity: Annotated[float, GravityByName()]

    def __post_init__(self) -> None:
        """Raise `InputError` for a centre of mass below the ground."""
        if self.centre_of_mass[1] < 0.0:
            raise InputError(
                f"centre_of_mass is {list(self.centre_of_mass)}; its height cannot be negative"
            )


@dataclass(frozen=True)
class _WheelTable:
    """The table [wheel] of a question."""

    radius: Annotated[Dimension, OpenSize()]
    width: Annotated[Dimension, OpenSize()]
    lug_height: Annotated[Dimension, OpenSize()]


@dataclass(frozen=True)
class ClimbingGoal:
    """What a design must do.

    slope: Slope that is climbed straight up, rad.
    margin: Pull that must be left on it, N.
    risk: Probability of failing that is accepted.
    slip_limit: Highest slip considered.
    torque_limit, energy_limit: Most torque of a wheel (N m) and work for each metre (J/m) on it.
    least: What is least among the designs that meet the goal, one of `LEAST`.
    """

    slope: Annotated[float, Parameter("rad", 0.0, math.radians(60.0), "climbed straight up")]
    margin: Annotated[float, Parameter("N", 0.0, 1e9, "pull left")] = 0.0
    risk: Annotated[float, Parameter("1", 0.001, 0.5, "probability of failing")] = RISK
    slip_limit: Annotated[float, Parameter("1", 0.01, 0.99, "highest slip")] = SLIP_LIMIT
    torque_limit: Annotated[float, Parameter("N m", 0.0, 1e9, "most torque")] = math.inf
    energy_limit: Annotated[float, Parameter("N", 0.0, 1e9, "most work for each metre")] = math.inf
    least: Annotated[str, OneOf(LEAST)] = "energy"


@dataclass(frozen=True)
class SoilQuestion:
    """The soils that a design may meet.

    entries: Published soils by name, as likely as each other; empty where the file states one soil.
    soil, prior, tests: The soil of the file, priors of its parameters, tests of it.
    rows: Model file and table of runs whose posterior is the soil; None without.
    """

    entries: Mapping[str, SoilEntry] = field(default_factory=dict)
    soil: Soil | None = None
    prior: Mapping[str, Prior] = field(default_factory=dict)
    tests: tuple[SoilTest, ...] = ()
    rows: tuple[Path, Path] | None = None

    @property
    def files(self) -> list[str]:
        """Files that it is read from beside the question's own."""
        return [] if self.rows is None else [str(path) for path in self.rows]


@dataclass(frozen=True)
class DesignStudy:
    """A rover whose dimensions are open within limits, the soils that it may meet, and its goal.

    dimensions: By name, as in `DIMENSIONS`.
    wheelbase: Distance of the first axle from the last, m; axles between are evenly spaced.
    centre_of_mass: How far it is ahead of the middle of the wheelbase, and above the ground, m.
    gravity: In m/s^2.
    """

    dimensions: Mapping[str, Dimension]
    wheelbase: float
    centre_of_mass: tuple[float, float]
    gravity: float
    soil: SoilQuestion
    goal: ClimbingGoal

    @property
    def varied(self) -> list[str]:
        """Names of the dimensions with more than one value."""
        return [name for name, own in self.dimensions.items() if own.varied]

    def axle_loads(self, wheels: int, slope: float) -> Floats:
        """Load on a wheel of each axle, front first, N for each kg of the rover's mass (axles,).

        Those of equally stiff wheels under a rigid body, see `WheeledRover.loads`; raises
        `InputError` where a wheel leaves the ground.
        """
        axles = wheels // 2
        places = self.wheelbase * (0.5 - np.arange(axles) / (axles - 1))
        forward, height = self.centre_of_mass
        one = {f"of axle {i + 1}": RoverWheel(float(x), 0.0) for i, x in enumerate(places)}
        rover = WheeledRover(1.0, (forward, 0.0, height), one, self.gravity)
        return np.asarray(0.5 * rover.loads(slope))


def read_study(path: str | os.PathLike[str]) -> DesignStudy:
    """Read a question of a design from a TOML file with [rover], [wheel], [soil] and [goal].

    Raises `InputError`, which names file, table and key, for a figure that is missing, misspelt or
    out of bounds: nothing of a rover is assumed.
    """
    settings = read_settings(path)
    rover = take_declared(_RoverTable, settings.table("rover"))
    wheel = take_declared(_WheelTable, settings.table("wheel"))
    sizes = {"radius": wheel.radius, "width": wheel.width, "lug_height": wheel.lug_height}
    sizes |= {"wheels": rover.wheels, "mass": rover.mass}
    study = DesignStudy(
        {name: sizes[name] for name in DIMENSIONS},
        rover.wheelbase,
        rover.centre_of_mass,
        rover.gravity,
        _take_soil(settings.table("soil")),
        take_declared(ClimbingGoal, settings.table("goal")),
    )
    settings.finish()
    return study


def _take_soil(settings: Settings) -> SoilQuestion:
    """One soil as in a model file, `names` of published ones, or `model` with `runs`."""
    if "model" in settings or "runs" in settings:
        rows = settings.file("model"), settings.file("runs")
        settings.finish()
        return SoilQuestion(rows=rows)
    content = dict(settings.content)
    if "names" in content:
        names = content.pop("names")
        if not (names and isinstance(names, list) and all(isinstance(n, str) for n in names)):
            settings.fail(f"names is {names!r}; needed is a list of published soils")
    else:
        names = [settings.text("name")] if "name" in settings else []
    try:
        entries = dict(published_soils(names).entries)
    except InputError as error:
        settings.fail(str(error))
    one = content | ({"name": names[0]} if names else {})
    own, prior, tests = take_soil(Settings(one, settings.where, settings.folder))
    if not names:
        return SoilQuestion({}, own, prior, tests)
    stated = content.keys() - {"name", "prior", "test"}
    if len(names) == 1:
        entry = entries[names[0]]
        spread = {k: v for k, v in entry.spread.items() if k not in stated}
        assumed = tuple(k for k in entry.assumed if k not in stated and k not in prior)
        entries = {names[0]: replace(entry, soil=own, spread=spread, assumed=assumed)}
    elif stated:
        settings.fail(f"{sorted(stated)[0]} is of one soil; for all of names write [soil.prior]")
    return SoilQuestion(entries, None, prior, tests)


def published_soils(names: list[str]) -> SoilQuestion:
    """Published soils, each as likely; `InputError` for a name that there is not."""
    for name in names:
        soil(name)  # raises for one that there is not
    return SoilQuestion({name: soil_catalogue()[name] for name in names})
