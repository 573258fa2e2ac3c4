"""Whether the bands of `soilml pull` cover what the soil truly gives, and by how much they miss."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, each, percent, table
from scipy.stats import binom

from soilml import SlipSinkage, read_case
from soilml.config.case import Case
from soilml.io.table import Table
from soilml.numerics.quantiles import QUANTILES, quantile_band
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.traction import DrivenVehicle, performance, pull_report
from soilml.traction.draws import SoilDraws

#: Soils that nothing was settled with; a load among those driven, and one that is not (N).
SEEDS, LOADS = range(20_000, 20_030), (75.0, 200.0)
#: Slips of the rows and of the table; rows of each soil; range of their loads, N.
SLIPS = (0.1, 0.3, 0.6)
ROWS, DRIVEN_LOADS = 6, (30.0, 120.0)
#: Who answers, and in which world.
DEFAULT, EXACT, LACKING = "default", "--exact-model", ", slip-sinkage missing"
KINDS = (DEFAULT, EXACT, DEFAULT + LACKING, EXACT + LACKING)
ABOUT = (
    "Coverage of 90 % bands of drawbar pull and of the steepest slope (docs/how-to/pull.md), over "
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
def known() -> tuple[Case, Case]:
    """The assumed case, and the world with an effect that it lacks."""
    case = read_case(ROOT / "examples/wheel/model.toml")
    digging = SlipSinkage(n1=SlipSinkage.about.reference["n1"])
    lacking = replace(case, model=case.model + digging)
    return case, lacking


def one_soil(asked: Row) -> list[Row]:
    """Bands of a soil of the prior under each load, beside the truth of its world."""
    case, lacking = known()
    by = asked["by"]
    world = lacking if by.endswith(LACKING) else case
    rng = np.random.default_rng(asked["seed"])
    truth = {name: prior.at(rng.random(1)) for name, prior in case.prior.items()}
    true = SoilDraws(tuple(truth), np.stack(list(truth.values()), axis=1))
    report = pull_report(
        case,
        simulated_rows(case, world, true, rng),
        loads=LOADS,
        slip_limit=SLIPS[-1],
        exact_model=by.startswith(EXACT),
    )
    rows = []
    for load, found in zip(LOADS, report.by_load, strict=True):
        band = found.posterior
        shown = [int(np.argmin(np.abs(band.curve_slip - s))) for s in SLIPS]
        wheel = DrivenVehicle.of_wheel(world, load)
        real = performance(wheel, true, np.zeros(0), band.curve_slip)
        slope = quantile_band(band.steepest_slope)
        rows.append(
            {
                "load": f"{load:g}",
                "pull": inside(band.pull, real.pull[0])[shown],
                "steepest": inside(band.steepest_slope, real.steepest_slope[0]),
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
