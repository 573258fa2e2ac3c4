"""The simulated sets of the benchmark: experimental design, readings and true soil."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from datagen.recipe import Block, Recipe
from datagen.simulation import block_sizes, simulate_rows
from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, column

#: Columns of a set that its hash covers: what every method reads.
HASHED_COLUMNS = ("slip", "load_N", "torque_Nm")
#: Significant digits that enter a hash: rows of two machines agree to more than these.
HASHED_DIGITS = 5


@dataclass(frozen=True)
class Design:
    """Experimental design of sets of one size.

    `loads` is the number of load levels of a set, 0 where loads are not restricted to levels;
    `grid` states whether every slip level is combined with every load level.
    """

    key: str
    rows: int
    loads: int
    grid: bool

    @property
    def description(self) -> str:
        """In words."""
        if self.rows == 1:
            return "1 row"
        levels = {0: "loads unrestricted", 1: "one load", 3: "three loads"}
        loads = levels.get(self.loads, f"{self.loads} loads")
        return f"{self.rows} rows, {loads}" + (", slips in a grid" if self.grid else "")


@dataclass(frozen=True)
class DesignSets:
    """Sets of one design: their rows, and the true values (n, q) of the estimated parameters."""

    design: Design
    tables: tuple[Table, ...]
    truth: Floats


def design_of(block: Block) -> Design:
    """The design of a recipe's runs."""
    levels = dict(block.levels)
    loads = 1 if block.rows == 1 or "load_N" in block.steady else levels.get("load_N", 0)
    return Design(block.label.rstrip("-"), block.rows, loads, "slip" in levels)


def generate_design_sets(
    recipe: Recipe, names: Sequence[str], max_sets: int | None = None
) -> list[DesignSets]:
    """Simulated sets of every design, the first `max_sets` of each; reproducible from the recipe.

    Raises `InputError` where a row has no equilibrium: stored posteriors refer to complete sets.
    """
    designs = []
    for number, (block, size) in enumerate(zip(recipe.blocks, block_sizes(recipe), strict=True)):
        available = size // block.rows
        count = available if max_sets is None else min(max_sets, available)
        table = Table(
            simulate_rows(recipe, number, 0, count * block.rows), f"recipe, runs of {block.rows}"
        )
        if not table.answered.all():
            raise InputError(f"{table.source}: a row has no equilibrium; narrow [operating]")
        rows_of_set = np.arange(len(table)).reshape(count, block.rows)
        truth = np.stack([table[column(name)][rows_of_set[:, 0]] for name in names], axis=1)
        tables = tuple(table.rows(rows) for rows in rows_of_set)
        designs.append(DesignSets(design_of(block), tables, truth))
    return designs


def recipe_with_effect(recipe: Recipe, effect: str) -> Recipe:
    """The same soils, slips and loads, simulated with an effect at its reference size."""
    cls = EFFECTS[effect]
    model = recipe.case.model + cls(**cls.about.reference)
    return replace(recipe, case=replace(recipe.case, model=model))


def select_channels(table: Table, channels: Sequence[str]) -> Table:
    """The table without the readings of all channels but these."""
    hidden = {column(c) for c in CHANNELS if c not in channels}
    return replace(table, columns={k: v for k, v in table.columns.items() if k not in hidden})


def set_hash(table: Table, case: Case) -> str:
    """Hash of a set's slips, loads and torques, and of the case's torque noise and priors."""
    text = [
        " ".join(f"{value:.{HASHED_DIGITS}g}" for value in table[name]) for name in HASHED_COLUMNS
    ]
    text += [repr(case.noise.get("torque_Nm")), repr(sorted(case.prior.items()))]
    return hashlib.sha256("\n".join(text).encode()).hexdigest()[:12]
