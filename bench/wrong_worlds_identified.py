"""Intervals of `identify` where sensors and model are wrong: `python bench/run.py model-errors`.

`python bench/wrong_worlds_identified.py` prints the table alone. Sets are those of
`bench/model_errors.py`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from scipy.stats import binom
from wrong_worlds import USUAL_BEARING, WORLDS, SimulatedDrives, simulate

from datagen.recipe import read_recipe
from soilml import Table, identify
from soilml.quantities import SHEAR, column

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Soils of each line, rows of each set, and the seed of both.
SETS, ROWS, SEED = 30, 16, 8


def scores(
    drives: SimulatedDrives, channels: Sequence[str], as_usual: bool
) -> tuple[Floats, float]:
    """Coverage (3,) of the 90 % intervals, and mean interval score in widths of the prior."""
    case = read_recipe("wheel").case
    covered, score = [], []
    for index, truth in enumerate(drives.truth):
        columns = {column(key): drives.readings[key][index] for key in ("slip", "load", *channels)}
        fit = identify(case, Table(columns), SHEAR, "posterior", as_usual=as_usual)
        low, high = fit.interval
        outside = np.maximum(low - truth, 0.0) + np.maximum(truth - high, 0.0)
        covered.append((truth >= low) & (truth <= high))
        score.append((high - low + 20.0 * outside) / [case.prior[name].std for name in SHEAR])
    return np.mean(covered, axis=0), float(np.mean(score))


def table() -> str:
    """A line for each world, channels side by side."""
    lines = [
        "| what is wrong | torque, first answer: 90 % of c, phi, K | score | second answer: 90 % | "
        "score | all channels, first answer: 90 % | score | second answer: 90 % | score |",
        "|---|---|---:|---|---:|---|---:|---|---:|",
    ]
    for world in (*WORLDS, USUAL_BEARING):
        drives, cells = simulate(world, SETS, ROWS, SEED), []
        for channels in (("torque",), ("torque", "sinkage", "drawbar_pull")):
            for as_usual in (False, True):
                covered, score = scores(drives, channels, as_usual)
                held = " / ".join(f"{100 * share:.0f}" for share in covered)
                cells.append(f"{held} | {score:.2f}")
        lines.append(f"| {world.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def section() -> str:
    """The table with its heading, and how far chance alone takes a cell."""
    low, high = (100.0 * binom.ppf(q, SETS, 0.9) / SETS for q in (0.025, 0.975))
    return (
        "### Posterior of the full model\n\n"
        "The second answer has a coverage of 90 % on average over errors of typical sizes, "
        "those of the last two lines, and not of each single error above them. Bearing pressure "
        "x 2 is an error of "
        f"1.7 standard deviations. By chance alone, 95 of 100 cells of {SETS} sets lie between "
        f"{low:.0f} and {high:.0f} where the coverage is 90.\n\n{table()}"
    )


if __name__ == "__main__":
    print(table())
