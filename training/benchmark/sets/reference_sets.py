"""Reference sets: the same for every file, with their exact posteriors kept beside them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np

from datagen.recipe import read_recipe
from soilml.physics.gears import Wheel
from soilml.quantities import SHEAR
from training.benchmark.designs import DIGITS
from training.benchmark.sets.exact_posterior import exact_posterior
from training.benchmark.sets.posterior_summary import ExactSetPosterior
from training.export.any_wheel_file import read_any_spec
from training.set_posterior.recipe_family import RecipeFamily
from training.set_posterior.wheel_family import ABSENT, SimulatedSets, WheelFamily

Progress = Callable[[str, int, int], None]

#: Rows of a set, sets of each size, and the seed, which nothing is trained or settled with.
SIZES = (1, 3, 6, 8, 16, 32)
COUNT = 170
SEED = 4711
#: Drawn for each set that is kept, for some leave the range.
DRAWN = 3
#: Whose sets they are.
ONE, ANY = "reference wheel", "any wheel"
PROCESSES = 2


@dataclass(frozen=True)
class Reference:
    """One set whose exact posterior is wanted."""

    label: str
    number: int
    family: WheelFamily
    sets: SimulatedSets  # this one alone
    effect: str = ""
    names: tuple[str, ...] = SHEAR

    @property
    def rows(self) -> int:
        """Rows of the set."""
        return int(self.sets.readings["slip"].shape[1])

    @property
    def design(self) -> str:
        """Whose set it is, and its size."""
        return f"{self.label}, {self.rows} rows"

    @property
    def hash(self) -> str:
        """What the stored posterior is recognised by: readings, context, and their noise."""
        own = self.sets
        named = sorted((own.readings | own.context).items())
        noise = [(name, np.stack(parts)) for name, parts in sorted(own.origin.noise.items())]
        text = [
            name + " ".join(f"{value:.{DIGITS}g}" for value in np.ravel(values))
            for name, values in [*named, *noise]
        ]
        ends = [f"{end:.{DIGITS}g}" for axis in self.family.axes for end in axis.ends]
        return hashlib.sha256("\n".join(text + ends).encode()).hexdigest()[:12]


def families() -> dict[str, WheelFamily]:
    """Wheels and soils of the reference sets, by label."""
    return {
        ONE: RecipeFamily.of(read_recipe("wheel"), SHEAR),
        ANY: read_any_spec("any_wheel").family,
    }


def references(most: int = COUNT) -> list[Reference]:
    """Every reference set, the first `most` of each size."""
    found = []
    for label, family in families().items():
        for rows in SIZES:
            sets = family.sets(DRAWN * COUNT, rows, SEED)
            places = [i for i in range(len(sets.truth)) if _may_be_given(family, sets.given(i))]
            found += [Reference(label, i, family, sets.only(i)) for i in places[:most]]
    return found


def _may_be_given(family: WheelFamily, context: Mapping[str, float]) -> bool:
    """Whether a file takes this context: sets are drawn a little beyond the ends of its range."""
    ends = family.limits()
    return all(ends[name][0] <= value <= ends[name][1] for name, value in context.items())


def computed(wanted: Sequence[Reference], progress: Progress) -> Iterator[ExactSetPosterior]:
    """The exact posterior of each, in order, from two processes."""
    with ProcessPoolExecutor(min(PROCESSES, os.cpu_count() or 1)) as pool:
        for done, found in enumerate(pool.map(_exact, wanted, chunksize=4), 1):
            progress("exact posteriors", done, len(wanted))
            yield found


def kept() -> Path:
    """The file that the exact posteriors are kept in."""
    return Path(str(resources.files("training.benchmark.sets").joinpath("sets_limit.parquet")))


def _exact(reference: Reference) -> ExactSetPosterior:
    return exact_posterior(reference.family, reference.sets, 0)


def on_one_wheel(references: Sequence[Reference]) -> list[Reference]:
    """Sets of the reference wheel as a file for wheels of any size is to answer them.

    The bearing curve is known, and the prior the same: coordinates of both families agree.
    """
    own, other = (families()[label] for label in (ONE, ANY))
    assert isinstance(own, RecipeFamily)
    case, found = own.recipe.case, []
    gear = case.model.gear
    assert isinstance(gear, Wheel)
    most = {axis.name: axis.ends[1] for axis in own.axes}
    given = {
        "wheel_radius": gear.radius,
        "wheel_width": gear.width,
        "bearing_modulus": case.soil.kc / gear.width + case.soil.kphi,
        "n": case.soil.n,
        "bearing_std": 0.0,
        "cohesion_max": most["cohesion"],
        "shear_modulus_max": most["shear_modulus"],
    }
    for reference in references:
        sets = reference.sets
        x = np.pad(sets.origin.x, ((0, 0), (0, len(other.axes) - len(own.axes))))
        context = {name: np.asarray([value]) for name, value in given.items()}
        sets = replace(sets, context=context, origin=replace(sets.origin, x=x))
        found.append(replace(reference, family=other, sets=sets))
    return found


def with_noise_of_reading(references: Sequence[Reference]) -> list[Reference]:
    """The same sets, told the noise that their sensors have at the reading, as a file takes it.

    The sets themselves tell the noise at the true value, which no rover knows.
    """
    found = []
    for reference in references:
        sets = reference.sets
        readings = dict(sets.readings)
        for name, (constant, share) in sets.origin.noise.items():
            channel = "torque" if name == "torque_bias" else name
            key = name if name == "torque_bias" else f"{name}_std"
            std = np.hypot(constant, share * np.abs(readings[channel]))
            readings[key] = np.where(readings[key] < ABSENT, std, ABSENT)
        found.append(replace(reference, sets=replace(sets, readings=readings)))
    return found
