"""Recipes of synthetic data: gear, soils, operating ranges, sensor noise, number of rows."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from datagen.gear_sensors import VIBRATION_COLUMN, StickSlip
from datagen.worlds import Worlds, take_worlds
from soilml.config.case import Case, take_case
from soilml.config.measurement_noise import Noise, take_noise
from soilml.config.model_settings import take_prior
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.gears.base import Gear
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.operating_point import COVARIATES, MOST_SLIP
from soilml.quantities import COLUMNS, column

#: Columns of [operating], in the order of their random numbers.
OPERATING_COLUMNS = ("slip", "load_N")
#: Columns of sensors, which may have noise and bias. Random streams follow this order.
SENSOR_COLUMNS = (
    "slip",
    "load_N",
    "torque_Nm",
    "drawbar_pull_N",
    "sinkage_m",
    VIBRATION_COLUMN,
)


@dataclass(frozen=True)
class Block:
    """Runs of one length: `share` of all rows are in runs of `rows` rows on one soil each.

    Within a run, the columns `steady` of [operating] keep one value. Those of `levels` take that
    many values, evenly spaced from end to end of the range, as a full factorial in which the first
    column varies fastest.
    """

    rows: int
    share: float
    steady: tuple[str, ...] = ()
    levels: tuple[tuple[str, int], ...] = ()

    @property
    def label(self) -> str:
        """The first part of the names of its runs."""
        levels = "".join(f"{count}{name}-" for name, count in self.levels)
        return f"{self.rows}x" + "".join(f"{name}-" for name in self.steady) + levels


@dataclass(frozen=True)
class Recipe:
    """The content of a recipe file; `content` is the file as it was read.

    `worlds`: what may act beside the model; None where the model is taken as right.
    """

    case: Case
    slip: Prior
    load: Prior
    covariates: dict[str, Prior]
    stick_slip: StickSlip | None
    bias: dict[str, Noise]
    blocks: tuple[Block, ...]
    rows: int
    seed: int
    content: dict[str, Any]
    worlds: Worlds | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.rows <= 10**10:
            raise InputError(f"rows is {self.rows}; needed is a whole number from 1 to 10^10")
        if not 0 <= self.seed < 2**63:
            raise InputError(f"seed is {self.seed}; needed is a whole number, 0 or more")

    def sized(self, rows: int | None = None, seed: int | None = None) -> Recipe:
        """The same recipe with another number of rows or another seed."""
        rows = self.rows if rows is None else rows
        seed = self.seed if seed is None else seed
        return replace(self, rows=rows, seed=seed)

    @property
    def driven(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Smallest and largest slip, and load (N)."""
        return (self.slip.lower, self.slip.upper), (self.load.lower, self.load.upper)

    @property
    def text(self) -> str:
        """Everything that determines the rows, as canonical JSON."""
        return json.dumps(self.content | {"rows": self.rows, "seed": self.seed}, sort_keys=True)

    @property
    def sha256(self) -> str:
        """Hash of `text`."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def packaged_file(path: str | os.PathLike[str], package: str, folder: str) -> Path:
    """The file at `path`, or a TOML file in a folder of a package, by its bare name.

    Raises `InputError` listing the packaged names where neither exists.
    """
    file = Path(path)
    if file.exists() or file.name != str(path):
        return file
    packaged = Path(str(resources.files(package).joinpath(folder)))
    match = packaged / f"{file.name.removesuffix('.toml')}.toml"
    if not match.is_file():
        names = ", ".join(sorted(f.stem for f in packaged.glob("*.toml")))
        raise InputError(f"{path}: there is no such file; packaged {folder}: {names}")
    return match


def read_recipe(
    path: str | os.PathLike[str], effects: Mapping[str, type[Effect]] = EFFECTS
) -> Recipe:
    """Read a recipe from a TOML file, or a packaged one by name.

    path: The file, or one of the names of `datagen/recipes`: wheel, wheel_test, wheel_leg,
        benchmark.
    effects: The effects that [[effect]] may name.

    Returns: Number of rows and seed can be replaced with `Recipe.sized`.

    Raises `InputError` where the file is missing or a key is missing, unknown or has a bad value;
    names the key.

    Examples
    --------
    >>> recipe = read_recipe("wheel")
    >>> recipe.rows, recipe.slip.lower, recipe.slip.upper
    (96000, 0.05, 0.6)
    >>> recipe.sized(rows=100).rows
    100
    """
    file = packaged_file(path, "datagen", "recipes")
    settings = read_settings(file)
    recipe = _take_recipe(settings, effects)
    settings.finish()
    return recipe


def parse_recipe(text: str, where: str) -> Recipe:
    """The recipe whose `Recipe.text` this is; `where` names its origin in messages.

    Raises `InputError` for a text that is no recipe.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise InputError(f"{where} is not a table in JSON")
    settings = Settings(content, where)
    recipe = _take_recipe(settings, EFFECTS)
    settings.finish()
    return recipe


def _take_recipe(settings: Settings, effects: Mapping[str, type[Effect]]) -> Recipe:
    case = take_case(settings, effects)
    if case.soil_tests:
        settings.fail(
            "[[soil.test]] is read by identify, gap, audit, advise and pull alone; the soils of a "
            "recipe are drawn from [soil.prior]"
        )
    if case.gears:
        settings.fail("a recipe has one gear, in [gear]; [gears.NAME] is for measured rows")
    if not case.prior:
        settings.fail("no parameter varies: give ranges in [soil.prior]")
    operating = settings.table("operating")
    slip, load = take_prior(operating, "slip"), take_prior(operating, "load_N")
    if not -MOST_SLIP < slip.lower < slip.upper < MOST_SLIP:
        operating.fail(
            f"slip is [{slip.lower:g}, {slip.upper:g}]; needed are slips between -1 and 1"
        )
    if load.lower <= 0:
        operating.fail(f"load_N begins at {load.lower:g}; needed are loads above 0 N")
    if case.simulator is not None:
        _check_simulated(operating, case.model.gear, slip, load)
    operating.permit(COVARIATES.values())
    covariates = {f: take_prior(operating, k) for f, k in COVARIATES.items() if k in operating}
    for effect in case.model.effects:
        for field in effect.about.needs:
            if field not in covariates:
                operating.fail(f"{COVARIATES[field]} is missing; the effect {effect.name} needs it")
    operating.finish()
    stick_slip = worlds = None
    if "stick_slip" in settings:
        stick_slip = StickSlip.take(settings.table("stick_slip"), case)
        if slip.lower < 0.0:
            operating.fail(f"slip begins at {slip.lower:g}; [stick_slip] needs slips of 0 or more")
    if "worlds" in settings:
        if stick_slip is not None:
            settings.fail("[worlds] and [stick_slip] in one recipe: needed is one")
        driven = (slip.lower, slip.upper), (load.lower, load.upper)
        given = frozenset(covariates)
        worlds = take_worlds(settings.table("worlds"), case, driven, effects, given)
    bias_settings = settings.table("bias")
    bias = {key: take_noise(bias_settings, key) for key in SENSOR_COLUMNS if key in bias_settings}
    bias_settings.permit(SENSOR_COLUMNS)
    bias_settings.finish()
    for key in case.noise.keys() - set(SENSOR_COLUMNS):
        settings.fail(f"[noise] {key}: a sensor of {COLUMNS[key].text} is not simulated")
    if VIBRATION_COLUMN in (*case.noise, *bias) and stick_slip is None:
        settings.fail(
            f"[noise] {VIBRATION_COLUMN}: the table [stick_slip] is missing, which adds it"
        )
    content = settings.content
    if case.simulator is not None:  # with its runs, so that it needs no other file
        content = content | {"simulator": case.simulator.within()}
    return Recipe(
        case=case,
        slip=slip,
        load=load,
        covariates=covariates,
        stick_slip=stick_slip,
        bias=bias,
        blocks=_take_blocks(settings),
        rows=settings.count("rows"),
        seed=int(settings.take("seed", int, "a whole number, 0 or more")),
        content=content,
        worlds=worlds,
    )


def _check_simulated(operating: Settings, gear: Gear, slip: Prior, load: Prior) -> None:
    """Fail where slip or load reaches beyond the runs of a simulator."""
    assert isinstance(gear, EmulatedGear)
    for name, own in (("slip", slip), ("load", load)):
        ends = np.asarray([own.lower, own.upper])
        if gear.beyond(name, ends).any():
            i = gear.inputs.index(name)
            operating.fail(
                f"{column(name)} is [{own.lower:g}, {own.upper:g}]; the runs of the simulator have "
                f"{gear.lower[i]:g} to {gear.upper[i]:g}: narrow it, or simulate more"
            )


def _take_blocks(settings: Settings) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for entry in settings.tables("runs"):
        block = Block(
            entry.count("rows", 1),
            entry.number("share", 1.0),
            _take_steady(entry),
            _take_levels(entry),
        )
        if not 0.0 < block.share <= 1.0:
            entry.fail(f"share is {block.share:g}; needed is a number above 0, up to 1")
        if block.steady and block.rows == 1:
            entry.fail("steady needs runs of 2 rows or more")
        if both := set(block.steady) & {name for name, _ in block.levels}:
            entry.fail(f"{both.pop()} is in steady and in levels; needed is one of them")
        if (combinations := math.prod(count for _, count in block.levels)) > block.rows:
            entry.fail(f"levels has {combinations} combinations; needed are that many rows or more")
        if block.label in {other.label for other in blocks}:
            entry.fail("another [[runs]] has the same rows, steady and levels; merge them")
        entry.finish()
        blocks.append(block)
    if not blocks:
        return (Block(1, 1.0),)
    if abs(sum(b.share for b in blocks) - 1.0) > 1e-9:
        settings.fail("the shares of [[runs]] must sum to 1")
    return tuple(blocks)


def _take_steady(entry: Settings) -> tuple[str, ...]:
    needed = f"a list of {', '.join(OPERATING_COLUMNS)}"
    names = entry.take("steady", list, needed, [])
    if any(names.count(name) != 1 or name not in OPERATING_COLUMNS for name in names):
        entry.fail(f"steady is {names!r}; needed is {needed}")
    return tuple(name for name in OPERATING_COLUMNS if name in names)


def _take_levels(entry: Settings) -> tuple[tuple[str, int], ...]:
    table = entry.table("levels")
    table.permit(OPERATING_COLUMNS)
    levels = tuple((name, table.count(name)) for name in OPERATING_COLUMNS if name in table)
    table.finish()
    for name, count in levels:
        if count < 2:
            entry.fail(f"levels has {count} for {name}; needed is 2 or more, or steady")
    return levels
