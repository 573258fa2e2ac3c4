"""Intervals of `identify` where sensors and model are wrong: `python bench/run.py model-errors`.

`python bench/wrong_worlds_identified.py [SETS [SEED]]` prints the table alone. Sets are those of
`bench/model_errors.py`, with worlds in which a law is another one.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from scipy.stats import binom
from wrong_worlds import LAW_WORLDS, WORLDS, World, simulate

from datagen.recipe import read_recipe
from soilml import Table, identify
from soilml.quantities import SHEAR, column

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Soils of each line, and the seed; half of the sets has the first number of rows, half the second.
SETS, SEED, ROWS = 10, 8, (16, 48)
CHANNELS = {"torque": ("torque",), "all channels": ("torque", "sinkage", "drawbar_pull")}
#: Coverage that is asked for in every world, and factor on widths that is reported.
TO_COVER, NOTABLE = 0.8, 2.0
#: Width of the central 90 % of a uniform prior, in its standard deviations.
PRIOR_WIDTH = 0.9 * np.sqrt(12.0)


@dataclass(frozen=True)
class AnswerScores:
    """Coverage (sets, 3) of 90 % intervals, and scores and widths (sets, 3) in prior deviations.

    `flagged` (sets,) says where a warning tells of excess residuals. `needed` (sets, 3) is the
    factor by which an interval would have to be wider to reach the truth.
    """

    covered: Floats
    score: Floats
    width: Floats
    flagged: Floats
    needed: Floats

    @property
    def cells(self) -> str:
        """Coverage by parameter, width over the prior's and interval score."""
        held = " / ".join(f"{100 * share:.0f}" for share in self.covered.mean(axis=0))
        return f"{held} | {self.width.mean() / PRIOR_WIDTH:.2f} | {self.score.mean():.2f}"


def scores(world: World, channels: Sequence[str], sets: int, seed: int) -> list[AnswerScores]:
    """Those of the averaged answer and of the exact model."""
    case = read_recipe("wheel").case
    found: tuple[list[Any], list[Any]] = ([], [])
    std = np.asarray([case.prior[name].std for name in SHEAR])
    for half, rows in enumerate(ROWS):
        drives = simulate(world, sets, rows, seed)
        for index in range(half, sets, len(ROWS)):
            truth = drives.truth[index]
            names = ("slip", "load", *channels)
            columns = {column(key): drives.readings[key][index] for key in names}
            fit = identify(case, Table(columns), SHEAR)
            for answer, own in zip((fit, fit.exact_model or fit), found, strict=True):
                low, high = answer.interval
                outside = np.maximum(low - truth, 0.0) + np.maximum(truth - high, 0.0)
                covered = ((truth >= low) & (truth <= high)).astype(float)
                flagged = any(r.code == "excess-residuals" for r in answer.warnings)
                width = (high - low) / std
                needed = np.abs(truth - 0.5 * (low + high)) / (0.5 * (high - low))
                own.append((covered, width + 20.0 * outside / std, width, flagged, needed))
    return [
        AnswerScores(*(np.asarray(part, dtype=float) for part in zip(*own, strict=True)))
        for own in found
    ]


def table(sets: int = SETS, seed: int = SEED) -> str:
    """A line for each world, channels side by side, and the means."""
    head = " | ".join(
        f"{name}, {answer}: 90 % of c, phi, K | width | score"
        for name in CHANNELS
        for answer in ("averaged", "exact_model")
    )
    lines = [f"| what is wrong | {head} |", "|---|" + "---|---:|---:|" * 4]
    worlds = (*WORLDS, *LAW_WORLDS)
    asked = [(world, channels) for world in worlds for channels in CHANNELS.values()]
    with ProcessPoolExecutor(max(os.cpu_count() or 1, 1)) as pool:
        jobs = [pool.submit(scores, world, channels, sets, seed) for world, channels in asked]
        found = [answer for job in jobs for answer in job.result()]
    columns = len(CHANNELS) * 2
    for i, world in enumerate(worlds):
        row = found[i * columns : (i + 1) * columns]
        lines.append(f"| {world.name} | {' | '.join(answer.cells for answer in row)} |")
    cells = []
    for k in range(columns):
        own = found[k::columns]
        held = np.mean([answer.covered.mean(axis=0) for answer in own], axis=0)
        width = np.mean([answer.width.mean() for answer in own]) / PRIOR_WIDTH
        score = np.mean([answer.score.mean() for answer in own])
        text = " / ".join(f"{100 * share:.0f}" for share in held)
        cells.append(f"{text} | {width:.2f} | {score:.2f}")
    lines.append(f"| mean | {' | '.join(cells)} |")
    notes = [*_notes(found, columns), *_hidden([w.name for w in worlds], found, columns)]
    return "\n".join([*lines, "", *notes])


def _notes(found: Sequence[AnswerScores], columns: int) -> list[str]:
    """Width of sound sets over that of the exact model, and coverage of sets without a flag."""
    texts = []
    for k, name in enumerate(CHANNELS):
        ratio = np.mean(found[2 * k].width / found[2 * k + 1].width)
        own = found[2 * k + columns :: columns]
        quiet = np.concatenate([answer.covered[answer.flagged == 0.0] for answer in own])
        texts.append(
            f"With {name}, the averaged interval is {ratio:.2f} times as wide as that of "
            "exact_model on sound sets. In the other worlds it covers "
            f"{100 * quiet.mean():.0f} % where nothing is flagged."
        )
    return texts


def _hidden(worlds: Sequence[str], found: Sequence[AnswerScores], columns: int) -> list[str]:
    """Worlds that the readings hardly tell from a sound one, and the width that they demand."""
    lines = [
        "Worlds in which the residuals of exact_model exceed the noise in at most half of the "
        f"sets. To cover {100 * TO_COVER:.0f} % there, its intervals would have to be wider by "
        "these factors, on sound sets too.",
        "",
        f"| world | {' | '.join(f'{c}: c | phi | K' for c in CHANNELS)} |",
        f"|---|{'---:|' * 3 * len(CHANNELS)}",
    ]
    for place, world in enumerate(worlds):
        cells = []
        for exact in found[columns * place + 1 : columns * (place + 1) : 2]:
            hidden = np.mean(exact.flagged) <= 0.5
            factor = np.quantile(exact.needed, TO_COVER, axis=0)
            cells += [f"{f:.1f}" if hidden and f > NOTABLE else "" for f in factor]
        if any(cells):
            lines.append(f"| {world} | {' | '.join(cells)} |")
    return [
        "",
        *lines,
        "",
        f"Factors up to {NOTABLE:.0f}, and worlds that residuals show, are blank.",
    ]


def section() -> str:
    """The table with its heading, and how far chance alone takes a cell."""
    low, high = (100.0 * binom.ppf(q, SETS, 0.9) / SETS for q in (0.025, 0.975))
    return (
        "### The averaged answer of identify\n\n"
        f"{SETS} sets of each world, half of {ROWS[0]} and half of {ROWS[1]} rows. Widths are over "
        "that of the prior; the interval score is in standard deviations of the prior, lower is "
        "better. Laws of the lower worlds have the reference sizes of the blind sets. By chance "
        f"alone, 95 of 100 cells of {SETS} sets lie between {low:.0f} and {high:.0f} where the "
        f"coverage is 90.\n\n{table()}"
    )


if __name__ == "__main__":
    print(table(*(int(text) for text in sys.argv[1:])))
