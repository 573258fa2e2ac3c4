"""Whether bands of pull and slope hold the truth as often as they say, over simulated soils."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.free_parameters import select_free
from soilml.identification.observations import read_observations
from soilml.io.table import Table
from soilml.numerics.quantile_band import QUANTILES, quantile_band
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.traction.onboard_draws import onboard_draws
from soilml.traction.pull_and_slope import Traction, traction
from soilml.traction.soil_draws import COUNT, SoilDraws, posterior_draws

Floats = NDArray[np.float64]

#: Slips at which is asked; six rows are driven between their ends, at loads (N) between these.
SLIPS = np.round(np.linspace(0.1, 0.6, 6), 12)
ROWS = 6
LOADS = (30.0, 120.0)


@dataclass(frozen=True)
class CoverageCount:
    """Of each soil (n, ...): share of draws below the truth, truth - middle, width of the band."""

    below: Floats
    off: Floats
    width: Floats

    @property
    def inside(self) -> Floats:
        """Share of soils whose truth lies in the band of nine tenths, (...)."""
        held = (self.below >= QUANTILES[0]) & (self.below <= QUANTILES[-1])
        return np.asarray(held.mean(axis=0))

    @property
    def reach(self) -> Floats:
        """How far from the middle nine of ten truths lie, in half-widths: 1 where bands hold."""
        return np.asarray(np.quantile(np.abs(self.off) / (0.5 * self.width), 0.9, axis=0))


@dataclass(frozen=True)
class Coverage:
    """What was covered under one load: pull (N) at `SLIPS`, and the steepest slope (rad)."""

    pull: CoverageCount
    steepest: CoverageCount


def coverage(
    case: Case,
    seeds: Iterable[int],
    loads: tuple[float, ...],
    *,
    world: Case | None = None,
    estimator: Estimator | None = None,
    count: int = COUNT,
) -> dict[float, Coverage]:
    """Drive soils drawn from the case's prior, predict, and compare with what they truly give.

    Six rows a soil with torque alone, with the case's noise; the soil by the posterior, or as
    `estimator` knows it, `count` draws of it. Rows and truths come
    from `world` where that is not the case.
    """
    found: dict[float, list[tuple[Traction, Traction]]] = {load: [] for load in loads}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = {name: prior.at(rng.random(1)) for name, prior in case.prior.items()}
        true = SoilDraws(tuple(truth), np.stack(list(truth.values()), axis=1))
        table = _driven(case, world or case, true, rng)
        if estimator is not None:
            draws = onboard_draws(estimator, case, table)[1]
        else:
            data = read_observations(case, table)
            draws = posterior_draws(case, data, select_free(case, None), count, seed).draws
        for load, pairs in found.items():
            made = traction(case, draws, load, SLIPS), traction(world or case, true, load, SLIPS)
            pairs.append(made)
    return {
        load: Coverage(
            _covered([(a.pull, b.pull[0]) for a, b in pairs]),
            _covered([(a.steepest, b.steepest[0]) for a, b in pairs]),
        )
        for load, pairs in found.items()
    }


def _driven(case: Case, world: Case, true: SoilDraws, rng: np.random.Generator) -> Table:
    """Six rows on the true soil, torque with the case's noise."""
    slip = SLIPS[0] + (SLIPS[-1] - SLIPS[0]) * (np.arange(ROWS) + rng.random(ROWS)) / ROWS
    load = rng.uniform(*LOADS, size=ROWS)
    there = true.of(world, np.zeros(ROWS, dtype=np.int64))
    torque = np.asarray(there.model(there.soil, Operating(slip=slip, load=load)).torque)
    key = column("torque")
    torque = torque + case.noise[key].std(torque) * rng.standard_normal(ROWS)
    run = np.full(ROWS, "simulated")
    return Table({"run": run, "slip": slip, "load_N": load, key: torque})


def _covered(pairs: list[tuple[Floats, Floats]]) -> CoverageCount:
    bands = [quantile_band(draws) for draws, _ in pairs]
    return CoverageCount(
        below=np.stack([np.mean(draws < truth, axis=0) for draws, truth in pairs]),
        off=np.stack([truth - b.middle for (_, truth), b in zip(pairs, bands, strict=True)]),
        width=np.stack([b.width for b in bands]),
    )
