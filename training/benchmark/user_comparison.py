"""Trained models and analytic identification on the same measured sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.identification import METHODS
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import column
from training.benchmark.methods import Method, MethodAnswers, analytic, held, prior_alone, trained

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

#: Sets of one size that are scored, and of these, how many the slower analytic methods are given.
MOST_SETS = 4000
ANALYTIC_SETS = 120
#: Least sets of a size that are worth scoring.
LEAST_SETS = 20


@dataclass(frozen=True)
class Line:
    """One line of the benchmark: a method on sets of one size, per parameter (q,)."""

    rows: int
    method: str
    inputs: str
    sets: int
    failed: int
    rmse: Floats
    relative: Floats
    cover50: Floats
    cover90: Floats
    seconds: float


def compare(
    case: Case,
    table: Table,
    estimators: dict[str, Estimator],
    progress: Progress = lambda text, done, total: None,
    analytic_sets: int = ANALYTIC_SETS,
) -> list[Line]:
    """Score prior, models and analytic methods on single rows and on every size of run there is.

    `case` gives the analytic methods their model, priors and noise. They see the same columns as
    the models (slip, torque, load); what a method needs beyond that is named in its line. Values
    outside the prior are moved to its edge, and a failed fit counts as the prior's mean.
    """
    first = next(iter(estimators.values()))
    names = first.names
    for label, estimator in estimators.items():
        if estimator.names != names:
            raise InputError(f"{label} estimates {estimator.names}, {first.path} {names}")
    for name in names:
        if name not in declared(Soil):
            raise InputError(
                f"{first.path} estimates {name}, which no analytic method finds; compare is for "
                f"{', '.join(declared(Soil))}"
            )
    prior = [case.prior.get(n) or Prior(lo, hi) for n, lo, hi in _ranges(first)]
    table = _usable(table, names)
    always = [prior_alone(prior)]
    always += [m for label, estimator in estimators.items() for m in trained(label, estimator)]
    slow = [analytic(case, method, names) for method in METHODS]
    lines = []
    for size, sets in _sets(table).items():
        truth = np.asarray([[s[column(n)][0] for n in names] for s in sets])
        for method in always:
            answers = method.answers(sets, len(names))
            lines.append(_line(size, method, truth, answers, prior))
        few = sets[:: max(len(sets) // analytic_sets, 1)][:analytic_sets]
        some = np.asarray([[s[column(n)][0] for n in names] for s in few])
        for method in slow:
            if all(column(c) in few[0] for c in method.channels):
                told = partial(progress, f"{method.name}, {size} rows")
                answers = method.answers(few, len(names), told)
                lines.append(_line(size, method, some, answers, prior))
    return lines


def _ranges(estimator: Estimator) -> list[tuple[str, float, float]]:
    ends = zip(estimator.prior.lower, estimator.prior.upper, strict=True)
    return [(n, float(a), float(b)) for n, (a, b) in zip(estimator.names, ends, strict=True)]


def _usable(table: Table, names: Sequence[str]) -> Table:
    for name in names:
        if column(name) not in table:
            raise InputError(
                f"{table.source}: column {column(name)} is missing: no truth to compare"
            )
    return table.rows(np.isfinite(table["torque_Nm"]) & table.answered)


def _sets(table: Table) -> dict[int, list[Table]]:
    """Sets by size: single rows, one from each run, and all runs of a length that is common."""
    runs = [rows for _, rows in table.groups("run")]
    step = max(len(runs) // MOST_SETS, 1)
    found = {1: [rows.rows(np.asarray([i % len(rows)])) for i, rows in enumerate(runs[::step])]}
    for size in sorted({len(rows) for rows in runs} - {1}):
        alike = [rows for rows in runs if len(rows) == size][:MOST_SETS]
        if len(alike) >= LEAST_SETS:
            found[size] = alike
    return found


def _line(
    size: int, method: Method, truth: Floats, answers: MethodAnswers, prior: Sequence[Prior]
) -> Line:
    lower, upper = np.asarray([p.lower for p in prior]), np.asarray([p.upper for p in prior])
    middle = np.asarray([float(p.at(np.asarray([0.5]))[0]) for p in prior])
    width = np.asarray([p.std for p in prior])
    failed = ~np.isfinite(answers.mean)
    value = np.where(failed, middle, np.clip(answers.mean, lower, upper))
    never = failed.all(axis=0)  # a parameter that the method does not estimate
    rmse = np.where(never, np.nan, np.sqrt(np.mean((truth - value) ** 2, axis=0)))
    return Line(
        rows=size,
        method=method.name,
        inputs=method.inputs,
        sets=len(truth),
        failed=int(failed[:, ~never].any(axis=1).sum()) if not never.all() else len(truth),
        rmse=rmse,
        relative=rmse / width,
        cover50=held(truth, answers.inner),
        cover90=held(truth, answers.outer),
        seconds=answers.seconds,
    )
