"""Runs that a simulator is to make: a design over slip, load and soil."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.numerics.gaussian_emulator import GaussianEmulator
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.soils import Soil
from soilml.quantities import column

Columns = dict[str, Floats]

#: Runs for each input: of a first design, and of further ones.
FIRST, FURTHER = 20, 5


def design_inputs(case: Case) -> dict[str, Prior]:
    """Each input of a design by column with its range: slip, load and the soil's priors.

    Raises `InputError` for a case without [simulator].
    """
    if case.simulator is None:
        raise InputError("the model file has no [simulator]; needed are its table, slip and load_N")
    found = {
        column("slip"): Prior(*case.simulator.slip),
        column("load"): Prior(*case.simulator.load, log=True),
    }
    soils = {column(name): prior for name, prior in case.prior.items() if name in declared(Soil)}
    if not soils:
        raise InputError("[soil.prior] is empty: runs vary the soil in the ranges of its priors")
    return found | soils


def space_filling_runs(case: Case, count: int, seed: int = 0) -> Columns:
    """A Latin hypercube of little discrepancy over slip, load and the priors of the soil.

    Returns columns (count,). Raises `InputError` as `design_inputs` does.

    References: McKay, Beckman and Conover, Technometrics 21(2), 1979; Fang, Li and Sudjianto,
    Design and Modeling for Computer Experiments, 2006 (centred discrepancy).
    """
    from scipy.stats import qmc

    inputs = design_inputs(case)
    sampler = qmc.LatinHypercube(len(inputs), rng=seed, optimization="random-cd")
    u = sampler.random(count)
    return {
        name: np.asarray([float(f"{x:.7g}") for x in prior.at(u[:, i])])
        for i, (name, prior) in enumerate(inputs.items())
    }


def emulator_errors(table: Table, gear: EmulatedGear, emulator: GaussianEmulator) -> list[str]:
    """A sentence for each channel: the error of its emulator, and its share of the spread."""
    spread = [max(float(np.std(table[column(name)])), 1e-300) for name in gear.channels]
    return [
        f"error of the emulator of {column(name)}: {own:.3g}, {100.0 * own / all_:.2g} % of the "
        "spread of the runs"
        for name, own, all_ in zip(gear.channels, emulator.error, spread, strict=True)
    ]
