"""Coverage of the bands of pull and slope over simulated soils."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.quantiles import QUANTILES, quantile_band
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.traction.draws import SoilDraws
from soilml.traction.pull_and_slope import Traction, predict_traction
from soilml.traction.soil_draws import DRAWS, estimated_soil, posterior_draws

Floats = NDArray[np.float64]

#: Slips of the predictions; rows of each soil; range of their loads, N.
SLIPS = np.round(np.linspace(0.1, 0.6, 6), 12)
ROWS = 6
LOADS = (30.0, 120.0)


@dataclass(frozen=True)
class CoverageCount:
    """Of each soil (n, ...): rank of the truth among the draws, truth - median, band width."""

    rank: Floats
    error: Floats
    width: Floats

    @property
    def covered(self) -> Floats:
        """Fraction of soils whose truth lies in the 90 % band, (...)."""
        inside = (self.rank >= QUANTILES[0]) & (self.rank <= QUANTILES[-1])
        return np.asarray(inside.mean(axis=0))


@dataclass(frozen=True)
class Coverage:
    """Coverage under one load: of pull (N) at `SLIPS`, and of the steepest slope (rad)."""

    pull: CoverageCount
    steepest_slope: CoverageCount


def coverage(
    case: Case,
    seeds: Iterable[int],
    loads: tuple[float, ...],
    *,
    world: Case | None = None,
    estimator: Estimator | None = None,
    count: int = DRAWS,
) -> dict[float, Coverage]:
    """Predict pull and slope of soils drawn from the case's prior, and compare with the truth.

    Each soil has `ROWS` simulated rows of torque with the case's noise, and is estimated by the
    posterior, or by `estimator`, with `count` draws. Rows and truths are simulated by `world` where
    that differs from the case.
    """
    found: dict[float, list[tuple[Traction, Traction]]] = {load: [] for load in loads}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = {name: prior.at(rng.random(1)) for name, prior in case.prior.items()}
        true = SoilDraws(tuple(truth), np.stack(list(truth.values()), axis=1))
        table = _simulated_rows(case, world or case, true, rng)
        if estimator is not None:
            draws = estimated_soil(estimator, case, table).draws
        else:
            readings = usable_readings(case, table)
            draws = posterior_draws(case, readings, select_free(case, None), count, seed)[0]
        for load, pairs in found.items():
            made = (
                predict_traction(case, draws, load, SLIPS),
                predict_traction(world or case, true, load, SLIPS),
            )
            pairs.append(made)
    return {
        load: Coverage(
            _coverage_count([(a.pull, b.pull[0]) for a, b in pairs]),
            _coverage_count([(a.steepest_slope, b.steepest_slope[0]) for a, b in pairs]),
        )
        for load, pairs in found.items()
    }


def _simulated_rows(case: Case, world: Case, true: SoilDraws, rng: np.random.Generator) -> Table:
    """Six rows on the true soil, torque with the case's noise."""
    slip = SLIPS[0] + (SLIPS[-1] - SLIPS[0]) * (np.arange(ROWS) + rng.random(ROWS)) / ROWS
    load = rng.uniform(*LOADS, size=ROWS)
    there = true.of(world, np.zeros(ROWS, dtype=np.int64))
    torque = np.asarray(there.model(there.soil, Operating(slip=slip, load=load)).torque)
    key = column("torque")
    torque = torque + case.noise[key].std(torque) * rng.standard_normal(ROWS)
    run = np.full(ROWS, "simulated")
    return Table({"run": run, "slip": slip, "load_N": load, key: torque})


def _coverage_count(pairs: list[tuple[Floats, Floats]]) -> CoverageCount:
    bands = [quantile_band(draws) for draws, _ in pairs]
    return CoverageCount(
        rank=np.stack([np.mean(draws < truth, axis=0) for draws, truth in pairs]),
        error=np.stack([truth - b.middle for (_, truth), b in zip(pairs, bands, strict=True)]),
        width=np.stack([b.width for b in bands]),
    )
