"""A recipe: which wheel, which soils, how driven, how measured, how many rows."""

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

from datagen.wheel_leg_vibration import StickSlip, take_stick_slip
from soilml.config.case import Case, take_case
from soilml.config.measurement_noise import Noise, take_noise
from soilml.config.prior import take_prior
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.gears import Midstance
from soilml.physics.operating_point import COVARIATES, MOST_SLIP
from soilml.quantities import COLUMNS

#: Columns of [operating], in the order in which they are drawn.
DRIVEN = ("slip", "load_N")
#: Columns that a sensor of the rover fills, and that may have noise and bias.
SENSED = ("slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m", "vibration_m_s2")
#: The sensor that [stick_slip] adds.
VIBRATION = SENSED[-1]


@dataclass(frozen=True)
class Block:
    """Runs of one length: `share` of all rows are in runs of `rows` rows on one soil each.

    Within a run, the columns `steady` of [operating] keep one value, and those of `levels` take
    that many, evenly from end to end of the range: row by row in turn, the first column fastest.
    """

    rows: int
    share: float
    steady: tuple[str, ...] = ()
    levels: tuple[tuple[str, int], ...] = ()

    @property
    def label(self) -> str:
        """What the names of its runs begin with."""
        levels = "".join(f"{count}{name}-" for name, count in self.levels)
        return f"{self.rows}x" + "".join(f"{name}-" for name in self.steady) + levels


@dataclass(frozen=True)
class Recipe:
    """What `soilml generate` makes; `content` is the file as it was read."""

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
    def text(self) -> str:
        """Everything that decides the rows, as canonical JSON."""
        return json.dumps(self.content | {"rows": self.rows, "seed": self.seed}, sort_keys=True)

    @property
    def sha256(self) -> str:
        """Hash of `text`."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def packaged_file(path: str | os.PathLike[str], package: str, folder: str) -> Path:
    """The file at `path`, or one that comes with the package, by its bare name.

    Raises `InputError` naming those that there are.
    """
    file = Path(path)
    if file.exists() or file.name != str(path):
        return file
    inside = Path(str(resources.files(package).joinpath(folder)))
    own = inside / f"{file.name.removesuffix('.toml')}.toml"
    if not own.is_file():
        names = ", ".join(sorted(f.stem for f in inside.glob("*.toml")))
        raise InputError(f"{path}: there is no such file; {folder} of the package: {names}")
    return own


def read_recipe(
    path: str | os.PathLike[str], effects: Mapping[str, type[Effect]] = EFFECTS
) -> Recipe:
    """The recipe in a TOML file, or a packaged one by name; raises `InputError` naming the key."""
    file = packaged_file(path, "datagen", "recipes")
    settings = read_settings(file)
    recipe = _take_recipe(settings, effects)
    settings.finish()
    return recipe


def parse_recipe(text: str, where: str) -> Recipe:
    """The recipe of which this is the `text`."""
    settings = Settings(json.loads(text), where, Path())
    recipe = _take_recipe(settings, EFFECTS)
    settings.finish()
    return recipe


def _take_recipe(settings: Settings, effects: Mapping[str, type[Effect]]) -> Recipe:
    case = take_case(settings, effects)
    if not case.prior:
        settings.fail("nothing varies: give ranges in [soil.prior]")
    operating = settings.table("operating")
    slip, load = take_prior(operating, "slip"), take_prior(operating, "load_N")
    if not -MOST_SLIP < slip.lower < slip.upper < MOST_SLIP:
        operating.fail(f"slip is [{slip.lower:g}, {slip.upper:g}]; it must lie between -1 and 1")
    if load.lower <= 0:
        operating.fail(f"load_N begins at {load.lower:g}; it must lie above zero")
    operating.knows(COVARIATES.values())
    covariates = {f: take_prior(operating, k) for f, k in COVARIATES.items() if k in operating}
    for effect in case.model.effects:
        for field in effect.about.needs:
            if field not in covariates:
                operating.fail(f"{COVARIATES[field]} is missing; the effect {effect.name} needs it")
    operating.finish()
    stick_slip = None
    if "stick_slip" in settings:
        stick_slip = take_stick_slip(settings.table("stick_slip"))
        if not isinstance(case.model.gear, Midstance):
            settings.fail(
                f"[stick_slip] is of wheel-legs; [gear] type is {case.model.gear.name!r}, needed "
                "is 'midstance'"
            )
        if slip.lower < 0.0:
            operating.fail(f"slip begins at {slip.lower:g}; [stick_slip] is for driving legs")
    bias_settings = settings.table("bias")
    bias = {key: take_noise(bias_settings, key) for key in SENSED if key in bias_settings}
    bias_settings.knows(SENSED)
    bias_settings.finish()
    for key in case.noise.keys() - set(SENSED):
        settings.fail(f"[noise] {key}: no sensor of {COLUMNS[key].text} is simulated")
    if VIBRATION in (*case.noise, *bias) and stick_slip is None:
        settings.fail(f"[noise] {VIBRATION}: give [stick_slip], which says how a leg vibrates")
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
        content=settings.content,
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
            entry.fail("steady is for runs of 2 rows or more")
        if both := set(block.steady) & {name for name, _ in block.levels}:
            entry.fail(f"{both.pop()} stands in steady and in levels; give it in one of them")
        if (cells := math.prod(count for _, count in block.levels)) > block.rows:
            entry.fail(f"levels has {cells} cells; needed are that many rows or more")
        if block.label in {other.label for other in blocks}:
            entry.fail("another [[runs]] has the same rows, steady and levels; make them one")
        entry.finish()
        blocks.append(block)
    if not blocks:
        return (Block(1, 1.0),)
    if abs(sum(b.share for b in blocks) - 1.0) > 1e-9:
        settings.fail("the shares of [[runs]] must sum to 1")
    return tuple(blocks)


def _take_steady(entry: Settings) -> tuple[str, ...]:
    needed = f"a list of {', '.join(DRIVEN)}"
    given = entry.take("steady", list, needed, [])
    if any(given.count(name) != 1 or name not in DRIVEN for name in given):
        entry.fail(f"steady is {given!r}; needed is {needed}")
    return tuple(name for name in DRIVEN if name in given)


def _take_levels(entry: Settings) -> tuple[tuple[str, int], ...]:
    given = entry.table("levels")
    given.knows(DRIVEN)
    found = tuple((name, given.count(name)) for name in DRIVEN if name in given)
    given.finish()
    for name, count in found:
        if count < 2:
            entry.fail(f"levels has {count} for {name}; needed is 2 or more, or steady")
    return found
