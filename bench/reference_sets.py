"""Reference sets: fixed simulated sets whose exact posteriors are stored beside this file.

`python bench/reference_sets.py` computes these posteriors again, seven minutes on two cores.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from exact_sets import ExactPosterior, exact_set_posterior

from datagen.recipe import read_recipe
from soilml.cli.progress import progress_bar
from soilml.errors import InputError
from soilml.onboard.set_contract import ABSENT_STD
from soilml.processes import process_map
from soilml.quantities import SHEAR
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.spec import read_any_wheel_spec

#: Rows per set, number of sets of each size, and a seed that no training or tuning uses.
SIZES = (1, 3, 6, 8, 16, 32)
COUNT = 170
SEED = 4711
#: Candidates simulated for each set that is used: some lie outside the range of the file.
CANDIDATES = 3
#: Significant digits that enter the hash of a set: two machines agree to more than these.
HASHED_DIGITS = 5
#: The exact posteriors of the reference sets, and what of them is stored.
STORED = Path(__file__).with_name("sets_limit.npz")
FIGURES = ("mean", "covariance", "quantiles", "flagged")
#: Labels of the two families; they are part of the stored design keys.
ONE_WHEEL, ANY_WHEEL = "reference wheel", "any wheel"


@dataclass(frozen=True)
class ReferenceSet:
    """One reference set; `sets` holds this one set alone."""

    label: str
    number: int
    family: WheelFamily
    sets: SimulatedSets

    @property
    def rows(self) -> int:
        """Rows of the set."""
        return int(self.sets.readings["slip"].shape[1])

    @property
    def design(self) -> str:
        """Key of the design: the family's label and the number of rows."""
        return f"{self.label}, {self.rows} rows"

    @property
    def hash(self) -> str:
        """Identifies the set that a stored posterior belongs to: readings, context, noise."""
        sets = self.sets
        inputs = sorted((sets.readings | sets.context).items())
        noise = sorted(sets.noise.items())
        text = [
            name + " ".join(f"{value:.{HASHED_DIGITS}g}" for value in np.ravel(values))
            for name, values in [*inputs, *noise]
        ]
        ends = [f"{end:.{HASHED_DIGITS}g}" for axis in self.family.axes for end in axis.ends]
        return hashlib.sha256("\n".join(text + ends).encode()).hexdigest()[:12]


def families() -> dict[str, WheelFamily]:
    """Wheels and soils of the reference sets, by label."""
    return {
        ONE_WHEEL: RecipeFamily.of(read_recipe("wheel"), SHEAR),
        ANY_WHEEL: read_any_wheel_spec("any_wheel").family,
    }


def generate_reference_sets(max_sets: int = COUNT) -> list[ReferenceSet]:
    """Every reference set, the first `max_sets` of each size."""
    references = []
    for label, family in families().items():
        for rows in SIZES:
            sets = family.sets(CANDIDATES * COUNT, rows, SEED)
            accepted = [i for i in range(len(sets.truth)) if _in_range(family, sets.context_of(i))]
            references += [
                ReferenceSet(label, i, family, _one_of(sets, i)) for i in accepted[:max_sets]
            ]
    return references


def _one_of(sets: SimulatedSets, index: int) -> SimulatedSets:
    own = slice(index, index + 1)
    readings = {name: values[own] for name, values in sets.readings.items()}
    context = {name: values[own] for name, values in sets.context.items()}
    noise = {name: values[:, own] for name, values in sets.noise.items()}
    arrays = (sets.truth, sets.designs, sets.x, sets.normal_std, sets.length)
    return SimulatedSets(readings, context, *(values[own] for values in arrays), noise)


def _in_range(family: WheelFamily, context: Mapping[str, float]) -> bool:
    """Whether a file accepts this context: candidates exceed the ends of its range slightly."""
    ends = family.limits()
    return all(ends[name][0] <= value <= ends[name][1] for name, value in context.items())


def stored_posteriors(references: Sequence[ReferenceSet]) -> dict[str, np.ndarray[Any, Any]]:
    """`FIGURES` of the exact posteriors of these sets, in their order.

    Raises `InputError` where the file has none of a set, or one of other rows.
    """
    with np.load(STORED) as file:
        stored = {name: file[name] for name in file.files}
    keys = zip(*(stored[name].tolist() for name in ("design", "number", "hash")), strict=True)
    index = {key: i for i, key in enumerate(keys)}
    rows = [index.get((one.design, one.number, one.hash)) for one in references]
    if None in rows:
        raise InputError(f"{STORED} is of other sets; compute it again: make limit")
    return {name: np.asarray(stored[name][rows], float) for name in FIGURES}


def with_noise_of_reading(references: Sequence[ReferenceSet]) -> list[ReferenceSet]:
    """The same sets, with standard deviations computed from the reading, as a rover must.

    The sets themselves have the standard deviation at the true value, which no rover can compute.
    """
    converted = []
    for reference in references:
        sets = reference.sets
        readings = dict(sets.readings)
        for name, (constant, share) in sets.noise.items():
            channel = "torque" if name == "torque_bias" else name
            key = name if name == "torque_bias" else f"{name}_std"
            std = np.hypot(constant, share * np.abs(readings[channel]))
            readings[key] = np.where(readings[key] < ABSENT_STD, std, ABSENT_STD)
        converted.append(replace(reference, sets=replace(sets, readings=readings)))
    return converted


def _exact(reference: ReferenceSet) -> ExactPosterior:
    return exact_set_posterior(reference.family, reference.sets, 0)


def store_posteriors() -> None:
    """Compute and store the exact posteriors of all reference sets."""
    references = generate_reference_sets()
    with (
        process_map(_exact, references) as found,
        progress_bar("exact posteriors", len(references)) as done,
    ):
        summaries = []
        for summary in found:
            summaries.append(summary)
            done(len(summaries))
    keys = {key: [getattr(r, key) for r in references] for key in ("design", "number", "hash")}
    figures = {n: np.asarray([getattr(s, n) for s in summaries], np.float32) for n in FIGURES}
    np.savez_compressed(STORED, **keys, **figures)
    flagged = sum(summary.flagged for summary in summaries)
    print(f"written: {STORED}, {len(summaries)} sets, {flagged} flagged")


if __name__ == "__main__":
    store_posteriors()
