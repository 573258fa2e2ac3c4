"""Files for a microcontroller beside the full files: accuracy on reference sets, and the board."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from benchmarks_file import ROOT
from numpy.typing import NDArray
from reference_sets import (
    ANY_WHEEL,
    ONE_WHEEL,
    ReferenceSet,
    generate_reference_sets,
    packaged_posteriors,
)

sys.path.insert(0, str(ROOT / "tests"))

from emulated_board import MISSING, run_on_board
from simulated_rows import ANY_WHEEL as WHEEL_AND_GROUND
from simulated_rows import rows_of

from soilml import Estimator
from soilml.cli import main
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS
from training.benchmark.bayes_limit_file import load_limit

Floats = NDArray[np.float64]
#: The full file beside each small one, and the reference sets that they are run on.
PAIRS = {"wheel_small": ("wheel", ONE_WHEEL), "any_wheel_small": ("any_wheel", ANY_WHEEL)}
#: The answers: with the model taken as right, as in the simulation; and the files' own.
EXACT, OWN = "model right", "own answer"
#: Rows that the emulated board steps through.
ROWS = 60


@dataclass(frozen=True)
class Answers:
    """What a file says of n sets."""

    mean: Floats  # (n, q)
    low: Floats
    high: Floats
    covariance: Floats  # (n, q, q)
    flags: NDArray[np.bool_]  # (n,) in_range

    def log_density(self, truth: Floats, scale: Floats) -> Floats:
        """Log density (n,) of a normal distribution with these moments, in units of the prior."""
        outer = scale[:, :, None] * scale[:, None, :]
        covariance, error = self.covariance / outer, (truth - self.mean) / scale
        solved = np.linalg.solve(covariance, error[..., None])[..., 0]
        determinant = np.linalg.slogdet(covariance)[1]
        return np.asarray(-0.5 * ((error * solved).sum(axis=1) + determinant))

    def covers(self, truth: Floats) -> NDArray[np.bool_]:
        """Which truths (n, q) lie in the 90 % intervals."""
        return (truth >= self.low) & (truth <= self.high)


@cache
def reference() -> tuple[list[ReferenceSet], Floats]:
    """The reference sets, and the exact posterior mean of each."""
    sets = generate_reference_sets()
    return sets, load_limit(packaged_posteriors(), sets, "make limit").mean


def answers_of(file: str, sets: list[ReferenceSet], own: bool) -> Answers:
    """A released file on some sets, each in one call."""
    plain = Estimator.load(ROOT / "exported" / f"{file}.onnx")
    exact = {} if own else dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
    found = []
    for one in sets:
        rows = one.sets.rows(0)
        for name in ("sinkage", "drawbar_pull"):
            rows[name] = np.where(rows[f"{name}_std"] < ABSENT_STD, rows[name], np.nan)
        estimator = plain.on(None, **one.sets.context_of(0), **exact)
        found.append(estimator.step(estimator.start(), **rows)[0])
    keys = ("mean", "low", "high", "covariance", "in_range")
    return Answers(*(np.stack([getattr(e, key) for e in found]) for key in keys))


def accuracy_table() -> str:
    """Accuracy of the small files beside the exact posterior and the full files."""
    lines = [
        "*RMSE over exact*: of the mean, over that of the exact posterior mean on the same sets. "
        "*Over full*: over that of the full file. *Gap*: mean log density at the truth of a normal "
        "distribution with the file's mean and covariance, that of the full file less that of the "
        "small one, nat, over sets that both have in range. *Coverage* of 90 % "
        "intervals, in brackets that of the full file. *Flags*: "
        "sets of which `in_range` is the same. Where errors of the model are inferred, the exact "
        "posterior, which knows that the model is right, is no yardstick.",
        "",
        "| file | answer | rows | sets | RMSE over exact: c | phi | K | over full: c | phi | K "
        "| gap, nat | coverage: c | phi | K | flags |",
        "|---|---|---:|---:|" + "---:|" * 11,
    ]
    sets, exact = reference()
    for small, (full, label) in PAIRS.items():
        chosen = [i for i, one in enumerate(sets) if one.label == label]
        some, limit = [sets[i] for i in chosen], exact[chosen]
        truth = np.concatenate([one.sets.truth for one in some])
        rows = np.asarray([one.rows for one in some])
        for answer in (EXACT, OWN):
            own = answer == OWN
            pair = answers_of(small, some, own), answers_of(full, some, own)
            for size in (*sorted(set(rows)), None):
                index = np.ones(len(rows), np.bool_) if size is None else rows == size
                cells = _cells(pair, truth, limit, index, own)
                name = "all" if size is None else size
                lines.append(f"| {small} | {answer} | {name} | {index.sum()} | {cells} |")
    return "\n".join(lines)


def _cells(
    pair: tuple[Answers, Answers],
    truth: Floats,
    exact: Floats,
    index: NDArray[np.bool_],
    own: bool,
) -> str:
    small, full = pair
    scale = np.broadcast_to(truth.std(axis=0), truth.shape)
    own_error, full_error, least = (
        np.sqrt((((mean - truth) / scale)[index] ** 2).mean(axis=0))
        for mean in (small.mean, full.mean, exact)
    )
    judged = index & small.flags & full.flags
    densities = (a.log_density(truth, scale)[judged].mean() for a in (full, small))
    gap = next(densities) - next(densities)
    covers = [a.covers(truth)[index].mean(axis=0) for a in pair]
    ratios = [""] * 3 if own else [f"{r:.3f}" for r in own_error / least]
    cells = [
        *ratios,
        *(f"{r:.3f}" for r in own_error / full_error),
        f"{gap:.3f}",
        *(f"{a:.1%} ({b:.1%})" for a, b in zip(*covers, strict=True)),
        f"{(small.flags == full.flags)[index].mean():.1%}",
    ]
    return " | ".join(cells)


def board_table(folder: Path) -> str:
    """Memory of the C code, and instructions and stack on an emulated Cortex-M4F."""
    lines = [
        "`soilml export-c --rows 1`, gcc -O2 with contraction of products and sums. Instructions "
        f"of one row with its answer, and stack: the largest of {ROWS} rows of one soil, emulated "
        "(`qemu-system-arm -M mps2-an386`). Goals: 64 kB of constants, 24 kB of working memory, 4 "
        "kB of state, 2 million instructions. At 168 MHz and two cycles an instruction, 2 million "
        "take 24 ms.",
        "",
        "| file | constants, kB | working memory, kB | state of a set, kB | rows with "
        "| instructions, million | stack, kB |",
        "|---|---:|---:|---:|---|---:|---:|",
    ]
    for name in PAIRS:
        source = folder / f"{name}.c"
        model = ROOT / "exported" / f"{name}.onnx"
        if main(["export-c", str(model), str(source), "--rows", "1"]):
            sys.exit(f"{name}.onnx cannot be exported")
        header = source.with_suffix(".h").read_text()
        defined = {n: int(v) for n, v in re.findall(r"#define (\w+_BYTES) (\d+)", header)}
        sizes = [defined[f"{name.upper()}_{p}_BYTES"] / 1e3 for p in ("CONSTANT", "WORK", "MEMORY")]
        for label, channels in (("torque", ()), ("all channels", ("sinkage", "drawbar_pull"))):
            counted = "not installed | "
            if not MISSING:
                context = WHEEL_AND_GROUND if name.startswith("any") else None
                rows = rows_of(np.random.default_rng(8), ROWS, context, channels)
                found = run_on_board(folder, name, rows, context)
                most = max(a.instructions for a in found) / 1e6
                counted = f"{most:.2f} | {max(a.stack for a in found) / 1e3:.1f}"
            cells = " | ".join(f"{size:.1f}" for size in sizes)
            lines.append(f"| {name} | {cells} | {label} | {counted} |")
    return "\n".join(lines)


def section(folder: Path) -> str:
    """Both tables."""
    return f"{board_table(folder)}\n\n{accuracy_table()}"
