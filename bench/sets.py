"""Set posteriors of the released files against the exact posteriors of the same sets.

`python bench/sets.py [FOLDER]` prints the tables; with --limit the exact posteriors are recomputed
and stored (seven minutes on two cores). The simulated noise is a share of the true value, or
constant. A file is fed standard deviations that are computed from the readings, as a rover's are.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from benchmarks_file import ROOT
from reference_sets import (
    ANY_WHEEL,
    CONSTANT,
    ONE_WHEEL,
    ReferenceSet,
    as_any_wheel_sets,
    compute_reference_posteriors,
    constant_noise_sets,
    generate_reference_sets,
    packaged_posteriors,
    with_noise_of_reading,
)
from set_comparison import (
    PosteriorComparison,
    compare_with_exact,
    pool_comparisons,
    uniformity_p_values,
)

from soilml.quantities import SHEAR
from training.benchmark.acceptance import COVERAGE_RANGE, SHEAR_SYMBOLS
from training.benchmark.bayes_limit_file import load_limit, save_limit

#: Goals: largest RMSE ratio, largest gap in log density (nat), smallest p-value of uniformity.
MAX_RATIO, MAX_GAP, MIN_P_VALUE = 1.05, 0.1, 0.01
#: A figure that misses its goal by less than this many standard errors is not a clear miss.
STANDARD_ERRORS = 2.0
#: Fewest sets of a measurement condition that is shown.
MIN_SETS = 30
#: Torque noise is split into thirds where its upper third exceeds the lower by this factor.
NOISE_SPREAD = 1.2
HINT = "compute it again: make limit"
#: Interior edges of bins: of ranks, of the 90 % interval, and of the stored exact quantiles.
RANK_EDGES, INTERVAL_EDGES = np.linspace(0.1, 0.9, 9), (0.05, 0.95)
QUANTILE_EDGES = (0.05, 0.25, 0.75, 0.95)


@cache
def measured(folder: Path) -> dict[str, list[PosteriorComparison]]:
    """Every file on its reference sets, by design."""
    references = _all_sets()
    limit = load_limit(packaged_posteriors(), references, HINT)
    of_label: dict[str, list[int]] = {r.label: [] for r in references}
    for index, reference in enumerate(references):
        of_label[reference.label].append(index)
    wheel, any_wheel = folder / "wheel.onnx", folder / "any_wheel.onnx"
    cases: dict[str, list[PosteriorComparison]] = {}

    def add(name: str, file: Path, label: str, sets: Sequence[ReferenceSet]) -> None:
        index = of_label[label]
        part = limit.subset(slice(index[0], index[-1] + 1))
        cases[f"{file.stem}, {name}"] = compare_with_exact(file, sets, part)

    own = {label: [references[i] for i in index] for label, index in of_label.items()}
    from_reading = {label: with_noise_of_reading(sets) for label, sets in own.items()}
    add(ONE_WHEEL, wheel, ONE_WHEEL, from_reading[ONE_WHEEL])
    add(ONE_WHEEL, any_wheel, ONE_WHEEL, as_any_wheel_sets(from_reading[ONE_WHEEL]))
    add(ANY_WHEEL, any_wheel, ANY_WHEEL, from_reading[ANY_WHEEL])
    for file, label in ((wheel, ONE_WHEEL + CONSTANT), (any_wheel, ANY_WHEEL + CONSTANT)):
        sets = from_reading[label]
        add(label, file, label, [replace(one, declares_noise=True) for one in sets])
        add(f"{label} fed by row", file, label, sets)
    return cases


def _all_sets() -> list[ReferenceSet]:
    """Reference sets with noise that is a share of the true value, and with constant noise."""
    return [*generate_reference_sets(), *constant_noise_sets()]


def rmse_table(folder: Path) -> str:
    """RMSE relative to the exact posterior, by set size"""
    head = " | ".join(f"{s} | s.e." for s in SHEAR_SYMBOLS)
    lines = [
        f"RMSE over that of the exact posterior mean on the same sets, with its standard error; of "
        f"the sets that the file answers. Goal: at most {MAX_RATIO:g} at every size.",
        "",
        f"| file, sets | rows | sets | refused | {head} | goal |",
        "|---|---:|---:|---:|" + "---:|" * 6 + "---|",
    ]
    for name, parts in measured(folder).items():
        for part in parts:
            ratio, error = part.rmse_ratio
            cells = " | ".join(f"{r:.3f} | {e:.3f}" for r, e in zip(ratio, error, strict=True))
            near = np.all(ratio - STANDARD_ERRORS * error <= MAX_RATIO)
            result = _result(bool(np.all(ratio <= MAX_RATIO)), bool(near))
            refused = 1.0 - part.estimates.answered.mean()
            lines.append(
                f"| {name} | {_rows(part)} | {len(part.truth)} | {refused:.1%} | {cells} "
                f"| {result} |"
            )
    return "\n".join(lines)


def log_density_table(folder: Path) -> str:
    """Log posterior density at the truth"""
    lines = [
        "Mean log density at the truth of all unknowns jointly (uncertain bearing included). "
        "*Exact*: of the exact posterior; *gap*: how far the posterior of the file is below it. "
        "Goal: "
        f"a gap of at most {MAX_GAP:g} nat.",
        "",
        "| file, sets | subset | sets | gap, nat | s.e. | exact, nat | goal |",
        "|---|---|---:|---:|---:|---:|---|",
    ]
    for name, parts in measured(folder).items():
        for part, label in _subsets(parts):
            gap, error = part.log_density_gap
            result = _result(gap <= MAX_GAP, gap - STANDARD_ERRORS * error <= MAX_GAP)
            lines.append(
                f"| {name} | {label} | {len(part.truth)} | {gap:.3f} | {error:.3f} "
                f"| {part.exact_log_density.mean():.2f} | {result} |"
            )
    return "\n".join(lines)


def coverage_table(folder: Path) -> str:
    """Coverage of intervals and ellipsoids"""
    low, high = COVERAGE_RANGE
    lines = [
        "Coverage of 90 % intervals, and of the joint 90 % ellipsoid of mean and covariance: of "
        "the file / of the exact posterior on the same sets. Goal: 90 % intervals cover "
        f"{low:.0%} to {high:.0%}. Coverage of an exact posterior is 90 % on average over the "
        "prior. It is not among soils of one third of the prior, where the posterior mean is "
        "shrunk towards the middle. Nor need a Gaussian ellipsoid cover 90 % of a posterior "
        "that is not Gaussian. A file reports 90 % intervals only: 50 % figures are of the "
        "posterior that its "
        "likelihood defines.",
        "",
        f"| file, sets | subset | sets | {' | '.join(SHEAR_SYMBOLS)} | joint | goal |",
        "|---|---|---:|" + "---:|" * 4 + "---|",
    ]
    for name, parts in measured(folder).items():
        whole = pool_comparisons(parts)
        for part, label in _subsets(parts):
            lines.append(_coverage_row(name, label, part, part.coverage90(), with_goal=True))
        lines.append(_coverage_row(name, "all, 50 %", whole, whole.coverage50, with_goal=False))
        for label, index in _thirds(whole).items():
            coverage = whole.coverage90(index)
            lines.append(_coverage_row(name, label, whole, coverage, with_goal=False))
    return "\n".join(lines)


def calibration_table(folder: Path) -> str:
    """Simulation-based calibration"""
    lines = [
        "Chi-square test of the truth's posterior rank against uniformity (Talts et al., "
        "arXiv:1804.06788, 2018), p-values. `ranks`: 10 bins of the rank in the posterior that "
        "the file's likelihood defines. `interval`: below, inside and above the file's own 90 % "
        "interval. `exact`: the exact posterior, in the bins of its stored quantiles. Goal: p "
        "at "
        f"least {MIN_P_VALUE:g}.",
        "",
        "| file, sets | sets | test | " + " | ".join(SHEAR_SYMBOLS) + " | goal |",
        "|---|---:|---|" + "---:|" * len(SHEAR_SYMBOLS) + "---|",
    ]
    for name, parts in measured(folder).items():
        whole = pool_comparisons(parts)
        answered = whole.subset(whole.estimates.answered)
        truth, exact = answered.truth, answered.exact
        interval = np.stack([answered.estimates.low, answered.estimates.high])
        quantiles = np.stack([exact.low, *answered.exact_interval50.swapaxes(0, 1), exact.high])
        ranks = {
            "ranks": (answered.rank, RANK_EDGES),
            "interval": (_binned_ranks(truth, interval, INTERVAL_EDGES), INTERVAL_EDGES),
            "exact": (_binned_ranks(truth, quantiles, QUANTILE_EDGES), QUANTILE_EDGES),
        }
        for test, (rank, edges) in ranks.items():
            p_values = uniformity_p_values(rank, edges)
            cells = " | ".join(f"{p:.2g}" for p in p_values)
            result = (
                "" if test == "exact" else _result(bool(np.all(p_values >= MIN_P_VALUE)), False)
            )
            lines.append(f"| {name} | {len(truth)} | {test} | {cells} | {result} |")
    return "\n".join(lines)


TABLES = (rmse_table, log_density_table, coverage_table, calibration_table)


def all_tables(folder: Path) -> str:
    """All tables, each under its heading."""
    return "\n\n".join(f"### {table.__doc__}\n\n{table(folder)}" for table in TABLES)


def _binned_ranks(truth: np.ndarray, edges: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    """Ranks (n, q): the middle of the bin of each truth among ascending edges (k, n, q)."""
    middles = 0.5 * (np.asarray([0.0, *ends]) + np.asarray([*ends, 1.0]))
    return middles[(truth > edges).sum(axis=0)]


def _subsets(parts: Sequence[PosteriorComparison]) -> list[tuple[PosteriorComparison, str]]:
    """All sets, those of each size, of each condition, and of low and high torque noise."""
    whole = pool_comparisons(parts)
    subsets = [(whole, "all")] if len(parts) > 1 else []
    subsets += [(part, f"{_rows(part)} row{'s' if _rows(part) > 1 else ''}") for part in parts]
    subsets += [
        (whole.subset(index), condition)
        for condition, index in whole.conditions.items()
        if MIN_SETS <= index.sum() < len(index)
    ]
    low, high = np.quantile(whole.noise, [1.0 / 3.0, 2.0 / 3.0])
    if high > NOISE_SPREAD * low:
        subsets.append((whole.subset(whole.noise < low), f"torque noise below {low:.1%}"))
        subsets.append((whole.subset(whole.noise > high), f"torque noise above {high:.1%}"))
    return subsets


def _thirds(whole: PosteriorComparison) -> dict[str, np.ndarray]:
    """Sets (n, q) whose truth is in each third of the prior."""
    fraction = (whole.truth - whole.lower) / (whole.upper - whole.lower)
    third = np.minimum((3.0 * fraction).astype(int), 2)
    names = ("truth in lower third", "truth in middle third", "truth in upper third")
    return {name: third == k for k, name in enumerate(names)}


def _coverage_row(
    name: str,
    label: str,
    part: PosteriorComparison,
    coverage: tuple[np.ndarray, np.ndarray],
    with_goal: bool,
) -> str:
    own, exact = coverage
    cells = " | ".join(f"{a:.1%} / {b:.1%}" for a, b in zip(own, exact, strict=True))
    joint, result = "", ""
    if with_goal:
        joint = " / ".join(f"{share:.1%}" for share in part.joint_coverage90)
        (low, high), margin = COVERAGE_RANGE, STANDARD_ERRORS * np.sqrt(0.09 / len(part.truth))
        inside = np.all((own >= low) & (own <= high))
        near = np.all((own >= low - margin) & (own <= high + margin))
        result = _result(bool(inside), bool(near))
    return f"| {name} | {label} | {len(part.truth)} | {cells} | {joint} | {result} |"


def _result(met: bool, near: bool) -> str:
    return "met" if met else f"missed, within {STANDARD_ERRORS:g} s.e." if near else "MISSED"


def _rows(part: PosteriorComparison) -> int:
    return int(part.design.split()[-2])


def recompute() -> None:
    """Compute and store the exact posteriors of all reference sets."""
    references = _all_sets()

    def report(text: str, done: int, total: int) -> None:
        if done % 200 == 0 or done == total:
            print(f"{text} {done} of {total}", file=sys.stderr, flush=True)

    summaries = list(compute_reference_posteriors(references, report))
    file = packaged_posteriors()
    save_limit(file, references, summaries)
    flagged = sum(s.flagged for s in summaries)
    print(
        f"written: {file}, {len(summaries)} sets of {', '.join(SHEAR)}, {flagged} flagged",
        file=sys.stderr,
    )


def main(arguments: Sequence[str]) -> None:
    """Print all tables, of the files in a folder; of the released ones without an argument."""
    if "--limit" in arguments:
        recompute()
        return
    print(all_tables(Path(arguments[0] if arguments else ROOT / "exported")))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main(sys.argv[1:])
