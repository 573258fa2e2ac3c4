"""Set posteriors of the released files beside the exact posteriors of the same simulated sets.

The simulated noise is a share of the true value. A file is fed standard deviations
that are computed from the readings, as a rover's are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from reference_sets import (
    ANY_WHEEL,
    COUNT,
    ONE_WHEEL,
    ReferenceSet,
    generate_reference_sets,
    stored_posteriors,
    with_noise_of_reading,
)
from runner import ROOT, Bench, Row, Sample, markdown

from soilml import Estimator
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS

Floats = np.ndarray[Any, np.dtype[np.float64]]

MAX_RATIO = 1.05  # Goal: largest RMSE ratio
COVERAGE_RANGE = (0.88, 0.92)  # Goal: coverage of 90 % intervals
SHEAR_SYMBOLS = ("c", "phi", "K")
#: A figure that misses its goal by less than this many standard errors is not a clear miss.
STANDARD_ERRORS = 2.0
#: Points of the midpoint rule that gives the prior's standard deviation.
PRIOR_POINTS = 4096
QUICK_SETS = 4
ABOUT = (
    "Estimates of the released files against the exact posteriors of the same simulated reference "
    "sets. `any_wheel` is measured over its whole range of wheels, loads, soils, bearing "
    "parameters, noise and bias. The noise is a share of the true value. A file is fed "
    "standard deviations that are this share of the reading, as a rover computes them. Goals of "
    "the files for a microcontroller are those of the full files."
)


#: File and its reference sets.
FED = {
    f"wheel, {ONE_WHEEL}": ("wheel", ONE_WHEEL),
    f"any_wheel, {ANY_WHEEL}": ("any_wheel", ANY_WHEEL),
    f"wheel_small, {ONE_WHEEL}": ("wheel_small", ONE_WHEEL),
    f"any_wheel_small, {ANY_WHEEL}": ("any_wheel_small", ANY_WHEEL),
}


@cache
def references(count: int) -> dict[tuple[str, int], list[ReferenceSet]]:
    """Reference sets, the first so many of each design, by label and number of rows."""
    found: dict[tuple[str, int], list[ReferenceSet]] = {}
    for one in generate_reference_sets(count):
        found.setdefault((one.label, one.rows), []).append(one)
    return found


def cases(sample: Sample) -> list[Row]:
    """Each file on the sets of each size."""
    count = QUICK_SETS if sample.quick else COUNT
    return [
        {"name": name, "rows": rows, "count": count}
        for name, (_, label) in FED.items()
        for own, rows in references(count)
        if own == label
    ]


def measured(case: Row) -> list[Row]:
    """Each set: errors and coverage of a file and of the exact posterior.

    The sensors of reference sets have no common errors but the bias of torque.
    """
    file, label = FED[case["name"]]
    plain = references(case["count"])[label, case["rows"]]
    limit = stored_posteriors(plain)
    estimator = Estimator.load(ROOT / "exported" / f"{file}.onnx")
    found, given = [], with_noise_of_reading(plain)
    for i, reference in enumerate(given):
        estimate = run_file(estimator, reference)
        sets = reference.sets
        truth, std = sets.truth[0], prior_std(reference)
        exact, ends = limit["quantiles"][i], np.stack([estimate.low, estimate.high])
        means = estimate.mean, limit["mean"][i]
        found.append(
            {
                "answered": bool(estimate.in_range),
                "error": [(mean - truth) / std for mean in means],
                "held90": [(low <= truth) & (truth <= high) for low, high in (ends, exact[[0, 3]])],
            }
        )
    return found


def run_file(estimator: Estimator, reference: ReferenceSet) -> Any:
    """The estimate of a file for a reference set."""
    sets = reference.sets
    rows = sets.rows(0)
    for name in ("sinkage", "drawbar_pull"):
        rows[name] = np.where(rows[f"{name}_std"] < ABSENT_STD, rows[name], np.nan)
    exact = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
    return estimator.on(None, **sets.context_of(0), **exact).run(**rows)


def prior_std(reference: ReferenceSet) -> Floats:
    """Standard deviation of the priors, (q,)."""
    context, u = reference.sets.context_of(0), (np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS
    axes = reference.family.axes[: reference.family.targets]
    scale = np.asarray([context.get(f"{axis.name}_max", 1.0) for axis in axes])
    return scale * [axis.value(axis.quantile(u)).std() for axis in axes]


def stacked(rows: Sequence[Row], member: str) -> Floats:
    """A member of all rows as an array."""
    return np.asarray([row[member] for row in rows])


def rmse_ratio(rows: Sequence[Row]) -> tuple[Floats, Floats]:
    """RMSE over that of the exact posterior, and its jackknife standard error, (q,) each.

    Of the sets that the file answers; errors are relative to the prior's standard deviation.
    """
    own, exact = (stacked([r for r in rows if r["answered"]], "error") ** 2).swapaxes(0, 1)
    without = np.sqrt((own.sum(axis=0) - own) / (exact.sum(axis=0) - exact))
    error = np.sqrt((len(own) - 1) * np.mean((without - without.mean(axis=0)) ** 2, axis=0))
    return np.sqrt(own.sum(axis=0) / exact.sum(axis=0)), error


def coverage(rows: Sequence[Row]) -> Floats:
    """Coverage (2, q) of 90 % intervals of the file and of the exact posterior."""
    return stacked([r for r in rows if r["answered"]], "held90").mean(axis=0)


def result(met: bool, near: bool = False) -> str:
    """Whether a goal is met."""
    return "met" if met else f"missed, within {STANDARD_ERRORS:g} s.e." if near else "MISSED"


def by_name(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each file on its sets."""
    found = {name: [r for r in rows if r["name"] == name] for name in FED}
    return {name: own for name, own in found.items() if own}


def by_size(rows: Sequence[Row]) -> dict[int, list[Row]]:
    """Rows by number of rows of the set."""
    return {n: [r for r in rows if r["rows"] == n] for n in dict.fromkeys(r["rows"] for r in rows)}


def subsets(rows: list[Row]) -> list[tuple[list[Row], str]]:
    """All sets, and those of each size."""
    parts = by_size(rows)
    found = [(rows, "all")] if len(parts) > 1 else []
    return found + [(own, f"{n} row{'s' if n > 1 else ''}") for n, own in parts.items()]


def rmse_table(rows: list[Row]) -> str:
    """RMSE relative to the exact posterior, by set size"""
    lines = []
    for name, whole in by_name(rows).items():
        for size, own in by_size(whole).items():
            ratio, error = rmse_ratio(own)
            near = bool(np.all(ratio - STANDARD_ERRORS * error <= MAX_RATIO))
            cells = [f"{x:.3f}" for pair in zip(ratio, error, strict=True) for x in pair]
            refused = f"{1.0 - stacked(own, 'answered').mean():.1%}"
            goal = result(bool(np.all(ratio <= MAX_RATIO)), near)
            lines.append((name, size, len(own), refused, *cells, goal))
    head = [word for symbol in SHEAR_SYMBOLS for word in (symbol, "s.e.")]
    return (
        "RMSE over that of the exact posterior mean on the same sets, with its standard error; of "
        f"the sets that the file answers. Goal: at most {MAX_RATIO:g} at every size.\n\n"
        + markdown(("file, sets", "rows", "sets", "refused", *head, "goal"), lines)
    )


def coverage_table(rows: list[Row]) -> str:
    """Coverage of 90 % intervals"""
    low, high = COVERAGE_RANGE
    lines = []
    for name, whole in by_name(rows).items():
        for own, label in subsets(whole):
            both = coverage(own)
            margin = STANDARD_ERRORS * np.sqrt(0.09 / len(own))
            inside = np.all((both[0] >= low) & (both[0] <= high))
            near = np.all((both[0] >= low - margin) & (both[0] <= high + margin))
            cells = [f"{file:.1%} / {exact:.1%}" for file, exact in both.T]
            lines.append((name, label, len(own), *cells, result(bool(inside), bool(near))))
    return (
        "Coverage of 90 % intervals of the file / of the exact posterior on the same sets. Goal: "
        f"{low:.0%} to {high:.0%}, which an exact posterior covers on average over the prior.\n\n"
        + markdown(("file, sets", "subset", "sets", *SHEAR_SYMBOLS, "goal"), lines, 2)
    )


def tables(rows: list[Row]) -> str:
    """All tables, each under its heading."""
    found = (rmse_table, coverage_table)
    return "\n\n".join(f"### {of.__doc__}\n\n{of(rows)}" for of in found)


SETS = Bench("sets", "Set posterior", ABOUT, cases, measured, tables)
