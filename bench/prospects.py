"""Whether the bands of `soilml pull` cover what the soil truly gives, and by how much they miss."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from benchmarks_file import ROOT
from coverage_study import SLIPS, Coverage, coverage
from scipy.stats import binom

from soilml import Estimator, SlipSinkage, read_case

#: Soils that nothing was settled with; a load among those driven, and one that is not (N).
SEEDS = range(20_000, 20_200)
DRAWS = 200
LOADS = (75.0, 200.0)


def prospects() -> str:
    """Coverage of 90 % bands of pull and of the steepest slope, as a table."""
    case = read_case(ROOT / "examples/wheel/model.toml")
    digging = replace(case, model=case.model + SlipSinkage(n1=SlipSinkage.about.reference["n1"]))
    onboard = Estimator.load(ROOT / "exported/wheel.onnx")
    kinds = {
        "posterior": coverage(case, SEEDS, LOADS, count=DRAWS),
        "exported/wheel.onnx": coverage(case, SEEDS, LOADS, count=DRAWS, estimator=onboard),
        "posterior, slip-sinkage missing": coverage(case, SEEDS, LOADS, count=DRAWS, world=digging),
    }
    return table(kinds)


def table(kinds: Mapping[str, Mapping[float, Coverage]]) -> str:
    """Share of soils inside each band, by what is known of the soil and by load."""
    slips = " | ".join(f"{s:g}" for s in SLIPS)
    lines = [
        f"| soil by | load, N | pull at slip {slips} | steepest | width | error | bias |",
        "|---|---:|" + "---:|" * (len(SLIPS) + 4),
    ]
    lines += [line for name, found in kinds.items() for line in _lines(name, found)]
    low, high = binom.interval(0.95, len(SEEDS), 0.9) / np.asarray(len(SEEDS))
    said = f"{len(SEEDS)} soils: 95 of 100 exact bands show {100 * low:.0f} to {100 * high:.0f} %."
    said += " Of the steepest slope, in degrees: width of the band, error that nine of ten stay "
    said += "within, bias (below zero: less steep than said)."
    return "\n".join([*lines, "", said])


def _lines(name: str, found: Mapping[float, Coverage]) -> Iterator[str]:
    for load, one in found.items():
        pulls = " | ".join(f"{100 * share:.0f} %" for share in one.pull.covered)
        wide = np.rad2deg(np.median(one.steepest_slope.width))
        reach = np.rad2deg(np.quantile(np.abs(one.steepest_slope.error), 0.9))
        bias = np.rad2deg(np.mean(one.steepest_slope.error))
        yield (
            f"| {name} | {load:g} | {pulls} | {100 * one.steepest_slope.covered:.0f} % "
            f"| {wide:.1f} | {reach:.1f} | {bias:+.1f} |"
        )


if __name__ == "__main__":
    print(prospects())
