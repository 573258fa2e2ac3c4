"""What a log gives to an adaptation: runs to analyse, runs to judge on, the recipe of a file."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, replace

import numpy as np

from datagen.recipe import SENSOR_COLUMNS, parse_recipe
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.fitting.readings import stack_readings, typical_std
from soilml.gap.checks import estimate_repeat_noise
from soilml.gap.held_out import RUNS_PER_HELD_OUT, split_holdout
from soilml.io.table import Table
from soilml.physics.gears.emulated import EmulatedGear
from soilml.quantities import SHEAR, column
from soilml.remarks import Remark
from training.set_posterior.families.recipe_family import MOST_UNKNOWNS, RecipeFamily
from training.set_posterior.response_surface import (
    LEAST_CARRIED,
    LEAST_DESIGNS,
    carried_shares,
    check_equilibria,
)

#: A file is trained this far beyond the slips of the log, and this factor beyond its loads.
SLIP_MARGIN, LOAD_FACTOR = 0.05, 1.2
#: Loads that the soils do not carry are left out until this share of slips and loads is carried.
CARRIED_CONDITIONS = 0.75
#: Slips that a file can be trained on.
LEAST_SLIP, MOST_SLIP = 0.01, 0.95
#: Runs of synthetic rows: their length, share and what is steady in them, as in the recipe `wheel`.
RUNS = "".join(
    f"[[runs]]\nrows = {rows}\nshare = {share}\nsteady = {steady}\n"
    for rows, share, steady in (
        (1, 0.52, []),
        (32, 0.14, []),
        (8, 0.06, []),
        (16, 0.10, ["load_N"]),
        (16, 0.10, ["slip"]),
        (8, 0.08, ["slip", "load_N"]),
    )
)


@dataclass(frozen=True)
class SplitRuns:
    """The rows of a log: those that are analysed, and those of whole runs that are kept back.

    None are kept back of a campaign of few runs.
    """

    campaign: Table
    kept_back: Table | None

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs that are kept back, in the order of the table."""
        if self.kept_back is None:
            return ()
        return tuple(dict.fromkeys(str(name) for name in self.kept_back["run"]))


def split_runs(table: Table, seed: int) -> SplitRuns:
    """Keep back a quarter of the runs, drawn with this seed; none of fewer than four."""
    if np.unique(table["run"]).size < RUNS_PER_HELD_OUT:
        return SplitRuns(table, None)
    parts = split_holdout(table, "run", seed)
    return SplitRuns(parts.analysed, parts.held_out)


@dataclass(frozen=True)
class DrivenRange:
    """Slips and loads (N) that a file is trained for."""

    slip: tuple[float, float]
    load: tuple[float, float]

    @staticmethod
    def of(table: Table, case: Case) -> DrivenRange:
        """The range of a log with a margin; rows that brake or roll freely are left out.

        It does not reach beyond the runs of a simulator. Raises `InputError` where no row drives.
        """
        driving = table["slip"] > 0.0
        if not driving.any():
            raise InputError(
                f"{table.source}: no row has a slip above 0; a file for the board is for driving "
                "wheels"
            )
        slip, load = table["slip"][driving], table["load_N"][driving]
        low = max(LEAST_SLIP, float(slip.min()) - SLIP_MARGIN)
        high = min(MOST_SLIP, float(slip.max()) + SLIP_MARGIN)
        slips = round(min(low, high - SLIP_MARGIN), 4), round(high, 4)
        loads = _three_digits(load.min() / LOAD_FACTOR), _three_digits(load.max() * LOAD_FACTOR)
        if isinstance(gear := case.model.gear, EmulatedGear):
            slips, loads = gear.cut("slip", slips), gear.cut("load", loads)
        return DrivenRange(slips, loads)


def _three_digits(x: float) -> float:
    return float(f"{x:.3g}")


def with_noise_of_log(case: Case, table: Table) -> Case:
    """The case with the noise of the log in those columns for which it declares none.

    It is the median of `<column>_std`, or else that of repeated rows. Raises `InputError` where the
    noise of torque is known from neither, and where no torque was measured.
    """
    readings = stack_readings(case, table)
    if "torque" not in readings.channels:
        raise InputError(
            f"{table.source}: no row has torque_Nm, from which a file for the board estimates"
        )
    readings = readings.with_default_std(estimate_repeat_noise(readings)[0])
    noise = dict(case.noise)
    for i, name in enumerate(readings.channels):
        std = readings.std[readings.channel == i]
        if column(name) not in noise and np.isfinite(std).any():
            noise[column(name)] = Noise(constant=_three_digits(float(np.nanmedian(std))))
    for key, stds in (("slip", readings.slip_std), ("load_N", readings.load_std)):
        if key not in noise and (std := typical_std(stds)) > 0.0:
            noise[key] = Noise(constant=_three_digits(std))
    if column("torque") not in noise:
        raise InputError(
            f"{table.source}: the noise of torque_Nm is not known; declare it in [noise] of the "
            "model, such as torque_Nm = '2 %'"
        )
    return replace(case, noise=noise)


def board_unknowns(case: Case) -> tuple[Case, list[Remark]]:
    """The case with as many priors as a file can have, and a remark on those that were dropped.

    The shear parameters come first, then the rest of the soil, then effects, of which the best
    known are dropped first: they stay at their values. Raises `InputError` where none of the shear
    parameters has a prior.
    """
    if not any(name in case.prior for name in SHEAR):
        raise InputError(
            f"none of {', '.join(SHEAR)} has a prior: give a range in [soil.prior] to what the "
            "board is to estimate"
        )
    parameters = case.parameters()

    def rank(path: str) -> tuple[int, float]:
        if path in SHEAR:
            return 0, 0.0
        if "." not in path:
            return 1, 0.0
        value = abs(float(parameters[path][1]))
        return 2, -case.prior[path].std / max(value, 1e-12)

    order = sorted(case.prior, key=rank)
    dropped = order[MOST_UNKNOWNS:]
    if not dropped:
        return case, []
    text = (
        f"{', '.join(dropped)}: fixed at the fitted value, because a file has at most "
        f"{MOST_UNKNOWNS} unknowns"
    )
    kept = {path: prior for path, prior in case.prior.items() if path not in dropped}
    return replace(case, prior=kept), [Remark("prior-fixed", text, tuple(dropped))]


def recipe_text(case: Case, driven: DrivenRange, rows: int, seed: int) -> str:
    """A recipe: soils of the priors, sensors of the case, slips and loads of the log.

    Errors of the model, with a remainder that was learned, and tests of the soil are left out:
    they are of one soil, and no part of a simulation of others.
    """
    bias = {key: noise for key, noise in case.bias.items() if noise.constant or noise.share}
    noise = {key: one for key, one in case.noise.items() if key in SENSOR_COLUMNS}
    own = replace(
        case, noise=noise, bias=bias, discrepancy={}, remainder=None, soil_tests=(), rover=None
    )
    top = f"rows = {rows}\nseed = {seed}\n\n"
    ends = f"[operating]\nslip = {list(driven.slip)}\nload_N = {list(driven.load)}\n"
    return f"{top}{case_as_toml(own)}\n{ends}\n{RUNS}"


def within_carried_loads(
    driven: DrivenRange, case: Case, seed: int
) -> tuple[DrivenRange, list[Remark]]:
    """The range for which a file can be trained, and a remark where its loads end earlier.

    Soils that carry some of the loads are no obstacle. Where most slips and loads are carried by
    less than half of the soils of the priors, the heavy loads are left out. Raises `InputError`
    where the light ones are not carried either.
    """
    recipe = json.dumps(tomllib.loads(recipe_text(case, driven, 1, seed)))
    family = RecipeFamily.of(
        parse_recipe(recipe, "the recipe of the log"),
        [name for name in SHEAR if name in case.prior],
    )
    designs, shares = carried_shares(family, seed)
    order = np.argsort(designs[:, 1])
    loads, carried = designs[order, 1], shares[order] >= LEAST_CARRIED
    up_to = np.cumsum(carried) / np.arange(1, len(order) + 1)  # share of those up to each load
    if up_to[-1] >= LEAST_DESIGNS:
        return driven, []
    enough = np.flatnonzero((up_to >= CARRIED_CONDITIONS) & (loads > LOAD_FACTOR * driven.load[0]))
    if enough.size == 0:
        check_equilibria(family, seed)
    most = _three_digits(loads[enough[-1]])
    text = (
        f"the file is for loads up to {most:g} N of {driven.load[1]:g} N: heavier ones sink to the "
        "hub on most soils of [soil.prior]; priors of firmer soils would reach further"
    )
    return replace(driven, load=(driven.load[0], most)), [Remark("loads-narrowed", text)]
