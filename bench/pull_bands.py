"""Whether the bands of `soilml pull` cover what the soil truly gives, and by how much they miss."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, each, percent, table
from scipy.stats import binom

from soilml import Estimator, SlipSinkage, read_case
from soilml.config.case import Case
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.quantiles import QUANTILES, quantile_band
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.traction.draws import SoilDraws
from soilml.traction.pull_and_slope import predict_traction
from soilml.traction.soil_draws import estimated_soil, posterior_draws

#: Soils that nothing was settled with; draws; a load among those driven, and one that is not (N).
SEEDS, DRAWS, LOADS = range(20_000, 20_200), 200, (75.0, 200.0)
#: Slips of the predictions; rows of each soil; range of their loads, N.
SLIPS = np.round(np.linspace(0.1, 0.6, 6), 12)
ROWS, DRIVEN_LOADS = 6, (30.0, 120.0)
KINDS = ("posterior", "exported/wheel.onnx", "posterior, slip-sinkage missing")
ABOUT = (
    "Coverage of 90 % bands of drawbar pull and of the steepest slope (docs/pull.md), over "
    f"{len(SEEDS)} simulated soils: 95 of 100 exact bands show "
    + " to ".join(f"{100 * x / len(SEEDS):.0f}" for x in binom.interval(0.95, len(SEEDS), 0.9))
    + " %. Each soil has six rows of torque with the case's noise. Of the steepest slope, in "
    "degrees: width of the band, error that nine of ten stay within, bias (below zero: less steep "
    "than said)."
)


def cases(sample: Sample) -> list[Row]:
    """Each soil by each kind of knowledge."""
    return [{"by": kind, "seed": s} for kind in KINDS for s in sample.of(SEEDS, 3)]


@cache
def known(kind: str) -> tuple[Case, Case, Estimator | None]:
    """The assumed case, that which simulates, and the estimator in the posterior's place."""
    case = read_case(ROOT / "examples/wheel/model.toml")
    world = case
    if kind == KINDS[2]:
        digging = SlipSinkage(n1=SlipSinkage.about.reference["n1"])
        world = replace(case, model=case.model + digging)
    file = Estimator.load(ROOT / "exported/wheel.onnx") if kind == KINDS[1] else None
    return case, world, file


def one_soil(asked: Row) -> list[Row]:
    """Bands of a soil under each load, beside the truth."""
    case, world, estimator = known(asked["by"])
    return soil_bands(case, world, estimator, asked["seed"], DRAWS)


def soil_bands(
    case: Case, world: Case, estimator: Estimator | None, seed: int, count: int
) -> list[Row]:
    """Bands of pull and slope of a soil that is drawn from the prior, from `count` draws.

    Rows and truths are simulated by `world`.
    """
    rng = np.random.default_rng(seed)
    truth = {name: prior.at(rng.random(1)) for name, prior in case.prior.items()}
    true = SoilDraws(tuple(truth), np.stack(list(truth.values()), axis=1))
    table = simulated_rows(case, world, true, rng)
    if estimator is not None:
        draws = estimated_soil(estimator, case, table).draws
    else:
        readings = usable_readings(case, table)
        draws = posterior_draws(case, readings, select_free(case, None), count, seed)[0]
    rows = []
    for load in LOADS:
        found, real = (
            predict_traction(model, own, load, SLIPS)
            for model, own in ((case, draws), (world, true))
        )
        slope = quantile_band(found.steepest_slope)
        rows.append(
            {
                "load": f"{load:g}",
                "pull": inside(found.pull, real.pull[0]),
                "steepest": inside(found.steepest_slope, real.steepest_slope[0]),
                "width": np.rad2deg(slope.width),
                "error": np.rad2deg(real.steepest_slope[0] - slope.middle),
            }
        )
    return rows


def inside(draws: Any, truth: Any) -> Any:
    """Whether truths lie in the 90 % bands of draws (d, ...)."""
    rank = np.mean(draws < truth, axis=0)
    return (rank >= QUANTILES[0]) & (rank <= QUANTILES[-1])


def simulated_rows(case: Case, world: Case, true: SoilDraws, rng: np.random.Generator) -> Table:
    """Six rows on the true soil, torque with the case's noise."""
    slip = SLIPS[0] + (SLIPS[-1] - SLIPS[0]) * (np.arange(ROWS) + rng.random(ROWS)) / ROWS
    load = rng.uniform(*DRIVEN_LOADS, size=ROWS)
    there = true.of(world, np.zeros(ROWS, dtype=np.int64))
    torque = np.asarray(there.model(there.soil, Operating(slip=slip, load=load)).torque)
    key = column("torque")
    torque = torque + case.noise[key].std(torque) * rng.standard_normal(ROWS)
    return Table({"run": np.full(ROWS, "simulated"), "slip": slip, "load_N": load, key: torque})


def tables(rows: list[Row]) -> str:
    """Share of soils inside each band, by what is known of the soil and by load."""
    columns = {
        f"pull at slip {s:g}": lambda own, k=k: (
            f"{100 * np.mean([r['pull'][k] for r in own]):.0f} %"
        )
        for k, s in enumerate(SLIPS)
    }
    columns |= {
        "steepest, %": percent("steepest"),
        "width": each("width", ".1f", np.median),
        "error": lambda own: f"{np.quantile(np.abs([r['error'] for r in own]), 0.9):.1f}",
        "bias": each("error", "+.1f"),
    }
    return table(rows, {"soil by": "by", "load, N": "load"}, columns)


PULL = Bench("pull", "Bands of drawbar pull and slope", ABOUT, cases, one_soil, tables)
