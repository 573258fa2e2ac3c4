"""Rows that a user holds out, rows kept back in turn, and the size of the gap on all of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.damped_descents import descent_if_any
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.gap.results import BeforeAfter, GapReduction
from soilml.inference.evidence import LinearisedFit
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import Hyperparameters, scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.inference.search import SOIL_STARTS
from soilml.io.table import Table
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal

#: `--holdout run` holds out one run in so many, and needs at least as many runs.
RUNS_PER_HELD_OUT = 4

#: The fitted rows, and the parts that are held out, by their keys in a report.
FITTED, RUNS = "train", "held_out_runs"
REGION, SLIPS = "held_out_region", "held_out_slips"
FOLDS = 4
#: Fraction of the readings, those of highest load or of highest slip, in the held-out region.
REGION_FRACTION = 0.3
#: Levels of slip up to which each is predicted from the others, where there is one load.
MOST_SLIP_LEVELS = 8
#: Squared residual, in variances, of a prediction without equilibrium: ten standard deviations.
INFEASIBLE_SQUARE = 100.0


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
        out = np.isin(table["run"], chosen)
        name, description = RUNS, f"runs {', '.join(sorted(map(str, chosen)))}"
    else:
        key, equals, value = holdout.partition("=")
        if not equals:
            raise InputError(f"--holdout is {holdout!r}; needed is run, or COLUMN=VALUE")
        rows = np.arange(len(table))
        out = np.isin(rows, replace(table, line=rows).where(key, value).line)
        name, description = REGION, holdout
    if out.all():
        raise InputError(f"--holdout {holdout} holds out every row; no row remains to analyse")
    return HoldoutSplit(table.rows(~out), table.rows(out), name, f"{description}, held out")


@dataclass(frozen=True)
class Folds:
    """Readings in folds, of which some are predicted from all readings outside them."""

    description: str
    fold: NDArray[np.int64]  # (m,)
    predicted: NDArray[np.int64]

    @property
    def selected(self) -> NDArray[np.bool_]:
        """The readings that are predicted, (m,)."""
        return np.isin(self.fold, self.predicted)


def held_out_folds(readings: Readings, seed: int) -> dict[str, Folds]:
    """The parts that are held out in turn, by name.

    Runs are predicted from the others, where there are at least three; the highest loads, or the
    highest slips where the load hardly varies, from the rest, where at least three loads or three
    slips were measured. Where neither runs nor loads are three, each slip is predicted from the
    others too.
    """
    parts, runs = {}, len(readings.runs)
    if runs >= 3:
        fold_of_run = np.random.default_rng(seed).permutation(runs) % min(FOLDS, runs)
        fold = fold_of_run[readings.run[readings.row]]
        parts[RUNS] = Folds("every run predicted by fits to the others", fold, np.unique(fold))
    if (region := held_out_region(readings)) is not None:
        name, out = region
        description = f"{name}, predicted from the rest"
        parts[REGION] = Folds(description, out.astype(np.int64), np.asarray([1]))
    slips = readings.slip_levels
    if runs < 3 and readings.load_levels.count < 3 and slips.count >= 3:
        fold = slips.index * min(slips.count, MOST_SLIP_LEVELS) // slips.count
        parts[SLIPS] = Folds("every slip predicted by fits to the others", fold, np.unique(fold))
    return parts


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


def predicted_by_refits(
    posterior: Posterior, fits: Sequence[Solution], parts: Mapping[str, Folds]
) -> list[dict[str, Floats]]:
    """Predictions (m,) of all parts by each fit, refitted without each fold; NaN outside.

    Under noise and scatter alone; without equilibrium, or where the model refuses the fit, NaN.
    """
    readings = posterior.terms.readings
    means = [{name: np.full(len(readings), np.nan) for name in parts} for _ in fits]
    for name, folds in parts.items():
        for number in folds.predicted:
            out = folds.fold == number
            whiten = posterior.terms.whiten(posterior.noise, posterior.outliers | out)
            for fit, mean in zip(fits, means, strict=True):
                problem = LeastSquaresProblem(fit.case, fit.coordinates, readings, whiten)
                if (solved := descent_if_any(problem, fit.x, fit.linearisation)) is not None:
                    mean[name][out] = solved.prediction[out]
    return means


def log_score(model: LinearisedFit, at: Hyperparameters, parts: Iterable[Folds]) -> float:
    """Log density of rows kept back beside a remainder: mean over the parts."""
    sums = [sum(model.log_density(at, own.fold == k) for k in own.predicted) for own in parts]
    return float(np.mean(sums))


def gap_reduction(
    readings: Readings, std: Floats, before: Floats, after: Floats, description: str
) -> GapReduction:
    """Mean squared standardised residuals of two predictions, in all and by channel.

    A prediction without equilibrium counts as ten standard deviations off.
    """
    squares = np.nan_to_num(
        ((readings.measured - np.stack([before, after])) / std) ** 2, nan=INFEASIBLE_SQUARE
    )
    channels = {
        column(name): BeforeAfter(*squares[:, own].mean(axis=1).tolist())
        for i, name in enumerate(readings.channels)
        if (own := readings.channel == i).any()
    }
    old, new = (float(mean) for mean in squares.mean(axis=1))
    return GapReduction(old, new, channels, len(readings), description)


def plain_soil(posterior: Posterior) -> Solution:
    """The soil alone, fitted under noise and scatter, without remainder."""
    soil = posterior.soil.fit
    problem = soil.whitened_by(posterior.whiten).problem
    elsewhere = [np.asarray([c.prior.fraction(c.nominal) for c in soil.coordinates])]
    elsewhere += [np.full(len(soil.x), x) for x in SOIL_STARTS]
    begun = [descent_if_any(problem, soil.x, soil.linearisation)]
    begun += [descent_if_any(problem, start) for start in elsewhere]
    carried = [f for f in begun if f is not None and np.isfinite(f.prediction).all()]
    stays = soil.whitened_by(posterior.whiten)
    return min(carried, key=lambda fit: fit.objective, default=stays)


def plain_fits(
    posterior: Posterior, alone: Solution, shown: Explanation | None
) -> tuple[Solution, Solution]:
    """The soil alone and the explanation shown, fitted as by `plain_soil`.

    The explanation starts from its optimum beside a remainder, and from the soil alone with the
    effect absent, so that its objective is at most that of the soil alone. It is the soil alone
    where none is shown, or the model refuses it.
    """
    if shown is None or not shown.hypothesis.effects:
        return alone, alone
    own, values = shown.fit.whitened_by(posterior.whiten).problem, alone.values()
    absent = [
        0.0 if c.effect else c.prior.fraction(values.get(c.path, c.nominal))
        for c in shown.fit.coordinates
    ]
    found = [descent_if_any(own, shown.fit.x, shown.fit.linearisation)]
    found += [descent_if_any(own, np.asarray(absent)), alone]
    return alone, min((fit for fit in found if fit is not None), key=lambda fit: fit.objective)


def gap_reductions(
    posterior: Posterior, fits: tuple[Solution, Solution], seed: int
) -> dict[str, GapReduction]:
    """Figures of the fitted rows and of rows kept back, by two fits without a smooth remainder.

    The total of the fitted rows is the sum of squares that the fits minimise, over the number of
    readings: that of whitened residuals, and of deviations from priors of effects and tests of the
    soil. Outliers count in none.

    fits: By `plain_fits`.
    """
    readings, kept = posterior.terms.readings, ~posterior.outliers

    def of(own: NDArray[np.bool_], means: Sequence[Floats], description: str) -> GapReduction:
        old, new = (mean[own] for mean in means)
        return gap_reduction(readings.subset(own), posterior.std[own], old, new, description)

    fitted = of(kept, [fit.prediction for fit in fits], "all rows fitted")
    before, after = (fit.objective / int(kept.sum()) for fit in fits)
    figures = {FITTED: replace(fitted, before=before, after=after)}
    parts = held_out_folds(readings, seed)
    models = fits[:1] if fits[1] is fits[0] else fits
    plain = predicted_by_refits(posterior, models, parts)
    for name, folds in parts.items():
        means = plain[0][name], plain[-1][name]
        figures[name] = of(kept & folds.selected, means, folds.description)
    return figures


def without_grown(
    figures: dict[str, GapReduction], addition: str
) -> tuple[dict[str, GapReduction], list[Remark]]:
    """The figures of the fitted rows and those that shrank, and a remark on each other one.

    addition: What was added to the model; where that is nothing, all figures stay as they are.
    """
    grown = {n: g for n, g in figures.items() if addition and n != FITTED and not g.shrinks}
    remarks = []
    for name, g in grown.items():
        before, after = (decimal(x, 3) for x in (g.before, g.after))
        text = f"with {addition} the mean squared residual is {after}, without it {before}"
        if before == after:
            text = f"the mean squared residual is {after} with and without {addition}"
        remarks.append(Remark("not-reduced", f"{g.description}: {text}", (name,), "note"))
    return {name: g for name, g in figures.items() if name not in grown}, remarks


def predict_held_out(
    posterior: Posterior, fits: tuple[Solution, Solution], readings: Readings, description: str
) -> GapReduction:
    """Gap reduction on rows that took no part in the analysis, predicted by both fits.

    Their noise is that of the analysed rows: at the predictions by the second fit, not at readings
    that may have strayed, and with what the noise of slip and load causes.
    """
    old, new = (predict(f.case, f.coordinates, f.x[None, :], readings)[0] for f in fits)
    readings = readings.with_noise_at(new)
    readings = readings.with_noise_of_operation(noise_of_operation(fits[1].fitted(), readings))
    columns = scatter_columns(fits[1].fitted(), readings)
    terms, at = terms_like(posterior.terms, posterior.noise, readings, columns)
    return gap_reduction(readings, terms.std(at), old, new, description)
