"""The measured sets of the benchmark: how each was driven, and what its soil truly is."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from datagen.generate import piece, sizes
from datagen.recipe import Block, Recipe
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]

#: Columns of a set that methods read of how it was driven and of its torque.
READ = ("slip", "load_N", "torque_Nm")
#: Significant digits that two machines' rows share.
DIGITS = 5


@dataclass(frozen=True)
class Design:
    """Sets of one size that were driven alike; `loads` is how many loads a set has, 0 for any."""

    key: str
    rows: int
    loads: int
    grid: bool

    @property
    def text(self) -> str:
        """In words."""
        if self.rows == 1:
            return "1 row"
        loads = {0: "loads free", 1: "one load", 3: "three loads"}
        said = loads.get(self.loads, f"{self.loads} loads")
        return f"{self.rows} rows, {said}" + (", slips in a grid" if self.grid else "")


@dataclass(frozen=True)
class DesignSets:
    """Sets of one design: their rows, and the truth (n, q) of the parameters asked for."""

    design: Design
    tables: tuple[Table, ...]
    truth: Floats

    def first(self, count: int | None) -> DesignSets:
        """The first sets, all where `count` is None."""
        return DesignSets(self.design, self.tables[:count], self.truth[:count])


def design_of(block: Block) -> Design:
    """The design of a recipe's runs."""
    levels = dict(block.levels)
    loads = 1 if block.rows == 1 or "load_N" in block.steady else levels.get("load_N", 0)
    return Design(block.label.rstrip("-"), block.rows, loads, "slip" in levels)


def sets_of(recipe: Recipe, names: Sequence[str], most: int | None = None) -> list[DesignSets]:
    """Every design's sets, the first `most` of each; the same recipe gives the same sets.

    Raises `InputError` where a row has no equilibrium: the limit would not be of the same rows.
    """
    found = []
    for number, (block, size) in enumerate(zip(recipe.blocks, sizes(recipe), strict=True)):
        count = size // block.rows if most is None else min(most, size // block.rows)
        table = Table(piece(recipe, number, 0, count * block.rows), f"recipe, runs of {block.rows}")
        if not table.answered.all():
            raise InputError(f"{table.source}: a row has no equilibrium; narrow [operating]")
        each = np.arange(len(table)).reshape(count, block.rows)
        truth = np.stack([table[column(name)][each[:, 0]] for name in names], axis=1)
        found.append(DesignSets(design_of(block), tuple(table.rows(rows) for rows in each), truth))
    return found


def with_effect(recipe: Recipe, effect: str) -> Recipe:
    """The same recipe driven with an effect at its reference; the same soils, slips and loads."""
    known = EFFECTS[effect](**EFFECTS[effect].about.reference)
    return replace(recipe, case=replace(recipe.case, model=recipe.case.model + known))


def shown(table: Table, channels: Sequence[str]) -> Table:
    """The rows without the readings of all other channels, as a method is given them."""
    hidden = {column(c) for c in CHANNELS if c not in channels}
    return replace(table, columns={k: v for k, v in table.columns.items() if k not in hidden})


def fingerprint(table: Table, case: Case) -> str:
    """Hash of a set's slips, loads and torques, and of what the case says of their noise."""
    text = [" ".join(f"{value:.{DIGITS}g}" for value in table[name]) for name in READ]
    text += [repr(case.noise.get("torque_Nm")), repr(sorted(case.prior.items()))]
    return hashlib.sha256("\n".join(text).encode()).hexdigest()[:12]
