"""Trained models and analytic identification on the same measured sets."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.case import Case
from soilml.errors import FitError, InputError
from soilml.identification import CLOSED_FORM, METHODS, identify
from soilml.onboard import Estimator
from soilml.parameters import declared
from soilml.prior import Prior
from soilml.quantities import CHANNELS, column
from soilml.soils import Soil
from soilml.table import Table
from training.score import HALF

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

#: Sets of one size that are scored, and of these, how many the slower analytic methods are given.
MOST_SETS = 4000
ANALYTIC_SETS = 120
#: What stands before the name of an analytic method in the table.
ANALYTIC = "analytic "
#: Least sets of a size that are worth scoring.
LEAST_SETS = 20


@dataclass(frozen=True)
class Answers:
    """One method's answers for sets (n,): value, std, 90 % interval (n, q); NaN where it failed."""

    value: Floats
    std: Floats
    low: Floats
    high: Floats
    seconds: float


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
    lines = []
    for size, sets in _sets(table).items():
        truth = np.asarray([[s[column(n)][0] for n in names] for s in sets])
        lines.append(_line(size, "prior", "-", truth, _prior_answers(prior, len(sets)), prior))
        for label, estimator in estimators.items():
            answers = _model_answers(estimator, sets)
            used = ", ".join(estimator.inputs)
            lines.append(_line(size, label, used, truth, answers, prior))
        few = sets[:: max(len(sets) // analytic_sets, 1)][:analytic_sets]
        some = np.asarray([[s[column(n)][0] for n in names] for s in few])
        for method in METHODS:
            inputs, answers = _analytic(case, method, few, names, progress, size)
            if inputs:
                lines.append(_line(size, f"{ANALYTIC}{method}", inputs, some, answers, prior))
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


def _prior_answers(prior: Sequence[Prior], count: int) -> Answers:
    fractions = np.asarray([0.05, 0.5, 0.95])
    ends = np.asarray([p.at(fractions) for p in prior])
    tiled = [np.tile(ends[:, k], (count, 1)) for k in range(3)]
    std = np.tile([p.std for p in prior], (count, 1))
    return Answers(tiled[1], std, tiled[0], tiled[2], 0.0)


def _model_answers(estimator: Estimator, sets: Sequence[Table]) -> Answers:
    """A call for each set, as on board: a single row alone, several together."""
    names = estimator.inputs
    started = time.perf_counter()
    found = []
    for rows in sets:
        readings = {name: rows[column(name)] for name in names}
        if len(rows) == 1:
            single = estimator(**{n: v[0] for n, v in readings.items()})
            found.append((single.mean, single.std, single.low, single.high))
        else:
            joint = estimator.run(**readings)
            found.append((joint.mean, joint.std, joint.low, joint.high))
    seconds = (time.perf_counter() - started) / len(sets)
    mean, std, low, high = (np.stack(part) for part in zip(*found, strict=True))
    return Answers(mean, std, low, high, seconds)


def _analytic(
    case: Case,
    method: str,
    sets: Sequence[Table],
    names: Sequence[str],
    progress: Progress,
    size: int,
) -> tuple[str, Answers]:
    """Answers of an analytic method, and what it reads; no inputs where the table lacks them."""
    channels = ["torque", "sinkage"] if method in CLOSED_FORM else ["torque"]
    if any(column(c) not in sets[0] for c in channels):
        nothing = np.zeros((0, 0))
        return "", Answers(nothing, nothing, nothing, nothing, 0.0)
    hidden = {column(c) for c in CHANNELS if c not in channels}
    shown = [
        replace(s, columns={k: v for k, v in s.columns.items() if k not in hidden}) for s in sets
    ]
    value = np.full((len(sets), len(names)), np.nan)
    std, low, high = (np.full_like(value, np.nan) for _ in range(3))
    started = time.perf_counter()
    for i, rows in enumerate(shown):
        progress(f"{method}, {size} rows", i, len(shown))
        try:
            fit = identify(case, rows, list(names), method)
        except FitError:
            continue
        for k, name in enumerate(names):
            if name in fit.names:
                own = fit.names.index(name)
                value[i, k], std[i, k] = fit.values[own], fit.std[own]
                low[i, k], high[i, k] = fit.interval[0][own], fit.interval[1][own]
    progress(f"{method}, {size} rows", len(shown), len(shown))
    seconds = (time.perf_counter() - started) / len(sets)
    given = {"linear": "; K given", "newton": "; c given"}.get(method, "")
    used = ", ".join(["slip", "load", *channels]) + given
    return used, Answers(value, std, low, high, seconds)


def _line(
    size: int, method: str, inputs: str, truth: Floats, answers: Answers, prior: Sequence[Prior]
) -> Line:
    lower, upper = np.asarray([p.lower for p in prior]), np.asarray([p.upper for p in prior])
    middle = np.asarray([float(p.at(np.asarray([0.5]))[0]) for p in prior])
    width = np.asarray([p.std for p in prior])
    failed = ~np.isfinite(answers.value)
    value = np.where(failed, middle, np.clip(answers.value, lower, upper))
    error = truth - value
    never = failed.all(axis=0)  # a parameter that the method does not estimate
    rmse = np.where(never, np.nan, np.sqrt(np.mean(error**2, axis=0)))
    inside = (truth >= answers.low) & (truth <= answers.high)
    halfway = np.abs(truth - answers.value) <= HALF * answers.std
    if method == "prior":
        halfway = np.abs(truth - middle) <= 0.25 * (upper - lower)
    answered = np.maximum((~failed).sum(axis=0), 1)
    return Line(
        rows=size,
        method=method,
        inputs=inputs,
        sets=len(truth),
        failed=int(failed[:, ~never].any(axis=1).sum()) if not never.all() else len(truth),
        rmse=rmse,
        relative=rmse / width,
        cover50=np.where(never, np.nan, halfway.sum(axis=0) / answered),
        cover90=np.where(never, np.nan, inside.sum(axis=0) / answered),
        seconds=answers.seconds,
    )
