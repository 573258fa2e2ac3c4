"""Rows that are held out: from the analysis, or from refits in cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import Covariance, assemble_covariance, run_effect_columns
from soilml.gap.evidence.problem import FitProblem, MarginalFit
from soilml.gap.report.results import BeforeAfter, GapReduction
from soilml.io.table import Table
from soilml.quantities import column

FOLDS = 4
#: Fraction of the readings, those of highest load or of highest slip, in the held-out region.
REGION_FRACTION = 0.3
#: Squared residual, in variances, of a prediction without equilibrium: ten standard deviations.
INFEASIBLE_SQUARE = 100.0


@dataclass(frozen=True)
class Folds:
    """Readings in folds, of which some are predicted from all readings outside them."""

    description: str
    fold: NDArray[np.int64]  # (m,)
    predicted: NDArray[np.int64]


def gap_reduction(
    readings: Readings, std: Floats, before: Floats, after: Floats, description: str
) -> GapReduction:
    """Mean squared standardised residuals of two predictions, in all and by channel.

    A prediction without equilibrium counts as ten standard deviations off.
    """

    def squares(y: Floats) -> Floats:
        return np.nan_to_num(((readings.measured - y) / std) ** 2, nan=INFEASIBLE_SQUARE)

    old, new = squares(before), squares(after)
    channels = {}
    for i, name in enumerate(readings.channels):
        in_channel = readings.channel == i
        if in_channel.any():
            means = float(old[in_channel].mean()), float(new[in_channel].mean())
            channels[column(name)] = BeforeAfter(*means)
    return GapReduction(float(old.mean()), float(new.mean()), channels, len(readings), description)


def held_out(
    problem: FitProblem, soil: MarginalFit, shown: MarginalFit, seed: int
) -> dict[str, GapReduction]:
    """Cross-validation by runs, and extrapolation to the highest loads.

    Runs are predicted by fits to the others, where there are at least three; the highest loads, or
    the highest slips where the load hardly varies, from the rest, where at least three loads or
    three slips were measured.
    """
    known = {}
    if (runs := _run_folds(problem.readings, seed)) is not None:
        known["held_out_runs"] = runs
    if (region := held_out_region(problem.readings)) is not None:
        name, out = region
        description = f"{name}, predicted from the rest"
        known["held_out_region"] = Folds(description, out.astype(np.int64), np.asarray([1]))
    return dict(zip(known, _cross_validate(problem, soil, shown, [*known.values()]), strict=True))


def _run_folds(readings: Readings, seed: int) -> Folds | None:
    """The runs in at most `FOLDS` folds at random; None where there are fewer than three."""
    runs = len(readings.runs)
    if runs < 3:
        return None
    fold_of_run = np.random.default_rng(seed).permutation(runs) % min(FOLDS, runs)
    fold = fold_of_run[readings.run[readings.row]]
    return Folds("every run predicted by fits to the others", fold, np.unique(fold))


def held_out_region(readings: Readings) -> tuple[str, NDArray[np.bool_]] | None:
    """The region of the highest loads, or of the highest slips where the load hardly varies.

    Its name and its readings (m,); None where fewer than three loads and fewer than three slips
    were measured.
    """
    by_load = readings.load_levels.count >= 3
    values = readings.load if by_load else readings.slip
    levels = readings.load_levels if by_load else readings.slip_levels
    if levels.count < 3:
        return None
    fractions = np.asarray([np.mean(levels.index >= i) for i in range(levels.count)])
    edge = values[levels.index == np.argmin(np.abs(fractions - REGION_FRACTION))].min()
    name = f"load_N >= {edge:.4g}" if by_load else f"slip >= {edge:.3g}"
    return name, values >= edge


def _cross_validate(
    problem: FitProblem, soil: MarginalFit, shown: MarginalFit, all_folds: Sequence[Folds]
) -> list[GapReduction]:
    """Predict each fold by both fits, repeated on all readings outside it."""
    fits = [soil] if shown is soil else [soil, shown]
    predicted = iter(_predict_folds(problem, [(fit, folds) for folds in all_folds for fit in fits]))
    reductions = []
    for folds in all_folds:
        before = next(predicted)
        after = before if shown is soil else next(predicted)
        selected = np.isin(folds.fold, folds.predicted)
        reductions.append(
            gap_reduction(
                problem.readings.subset(selected),
                problem.covariance.std[selected],
                before[selected],
                after[selected],
                folds.description,
            )
        )
    return reductions


def _predict_folds(
    problem: FitProblem, wanted: Sequence[tuple[MarginalFit, Folds]]
) -> list[Floats]:
    """Predictions (m,) of each fold by the same fit, repeated to all other readings.

    The fits are made beside the same discrepancy, from its optimum. Readings of a fold without a
    fit, and those of other folds, are NaN.
    """
    readings = problem.readings
    problems, starts, where = [], [], []
    for i, (marginal, folds) in enumerate(wanted):
        fit, amplitude = marginal.fit, marginal.evidence.amplitude
        for number in folds.predicted:
            rest = folds.fold != number
            known = problem.discrepancy.of_readings(rest, readings.run[readings.row])
            kept, whiten = readings.subset(rest), known.whiten(amplitude)
            problems.append(LeastSquaresProblem(fit.case, fit.coordinates, kept, whiten))
            starts.append(fit.x)
            where.append((i, ~rest))
    predicted = [np.full(len(readings), np.nan) for _ in wanted]
    for (i, out), again in zip(where, descend_together(problems, starts), strict=True):
        if isinstance(again, InputError):
            continue
        y = predict(again.case, again.coordinates, again.x[None, :], readings)[0]
        predicted[i][out] = y[out]
    return predicted


def predict_held_out(
    problem: FitProblem, soil: Solution, shown: Solution, readings: Readings, description: str
) -> GapReduction:
    """Gap reduction on rows that took no part in the analysis, predicted by both fits."""
    before = predict(soil.case, soil.coordinates, soil.x[None, :], readings)[0]
    after = predict(shown.case, shown.coordinates, shown.x[None, :], readings)[0]
    std = covariance_at(problem, shown, readings).std
    return gap_reduction(readings, std, before, after, description)


def covariance_at(problem: FitProblem, fit: Solution, readings: Readings) -> Covariance:
    """The covariance of other readings, by the variance components of the problem."""
    components = problem.covariance.components
    index = {name: i for i, name in enumerate(problem.readings.channels)}
    scale = np.asarray(
        [components.noise_scale[index[n]] if n in index else 1.0 for n in readings.channels]
    )
    columns = run_effect_columns(fit.fitted(), readings)
    return assemble_covariance(readings, columns, replace(components, noise_scale=scale))


#: `--holdout run` holds out one run in so many, and needs at least as many runs.
RUNS_PER_HELD_OUT = 4


@dataclass(frozen=True)
class HoldoutSplit:
    """The rows to analyse and those held out; `name` is the entry of the report's figures."""

    analysed: Table
    held_out: Table | None = None
    name: str = ""
    description: str = ""


def split_holdout(table: Table, holdout: str | None, seed: int) -> HoldoutSplit:
    """Split a table by `run` (a quarter of the runs, at random) or by `COLUMN=VALUE`.

    Raises `InputError` for another text, for too few runs, or where no row remains to analyse.
    """
    if holdout is None:
        return HoldoutSplit(table)
    if holdout == "run":
        runs = np.unique(table["run"])
        if runs.size < RUNS_PER_HELD_OUT:
            raise InputError(f"--holdout run needs four runs or more; the table has {runs.size}")
        count = max(1, runs.size // RUNS_PER_HELD_OUT)
        chosen = np.random.default_rng(seed).permutation(runs)[:count]
        held_out = np.isin(table["run"], chosen)
        name, description = "held_out_runs", f"runs {', '.join(sorted(map(str, chosen)))}"
    else:
        key, equals, value = holdout.partition("=")
        if not equals:
            raise InputError(f"--holdout is {holdout!r}; needed is run, or COLUMN=VALUE")
        rows = _positions(table, table.where(key, value))
        held_out = np.isin(np.arange(len(table)), rows)
        name, description = "held_out_region", holdout
    if held_out.all():
        raise InputError(f"--holdout {holdout} holds out every row; no row remains to analyse")
    description += ", held out"
    return HoldoutSplit(table.rows(~held_out), table.rows(held_out), name, description)


def _positions(table: Table, rows: Table) -> NDArray[np.int64]:
    """Positions of the rows of a part in the whole table: by line, else by content."""
    if len(table.line):
        return np.flatnonzero(np.isin(table.line, rows.line))
    keys = [tuple(str(table[n][i]) for n in table.columns) for i in range(len(table))]
    own = {tuple(str(rows[n][i]) for n in rows.columns) for i in range(len(rows))}
    return np.asarray([i for i, key in enumerate(keys) if key in own], dtype=np.int64)
