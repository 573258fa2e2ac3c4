"""Prediction of rows that were kept back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.readings import Readings
from soilml.inference.conditional import conditional
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Names, Posterior

#: The parts that are held out, by their keys in a report.
RUNS, REGION, SLIPS = "held_out_runs", "held_out_region", "held_out_slips"
FOLDS = 4
#: Fraction of the readings, those of highest load or of highest slip, in the held-out region.
REGION_FRACTION = 0.3
#: Levels of slip up to which each is predicted from the others, where there is one load.
MOST_SLIP_LEVELS = 8
#: Squared residual, in variances, of a prediction without equilibrium: ten standard deviations.
INFEASIBLE_SQUARE = 100.0


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
    parts = {}
    if (runs := _run_folds(readings, seed)) is not None:
        parts[RUNS] = runs
    if (region := held_out_region(readings)) is not None:
        name, out = region
        description = f"{name}, predicted from the rest"
        parts[REGION] = Folds(description, out.astype(np.int64), np.asarray([1]))
    slips = readings.slip_levels
    if runs is None and readings.load_levels.count < 3 and slips.count >= 3:
        fold = slips.index * min(slips.count, MOST_SLIP_LEVELS) // slips.count
        text = "every slip predicted by fits to the others"
        parts[SLIPS] = Folds(text, fold, np.unique(fold))
    return parts


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


def predicted_by_refits(
    posterior: Posterior, fits: Sequence[Solution], parts: Mapping[str, Folds]
) -> list[dict[str, Floats]]:
    """Predictions (m,) of all parts by each fit, refitted without each fold; NaN outside.

    Under noise and scatter alone; without equilibrium, or where the model refuses the fit, NaN.
    """
    readings = posterior.terms.readings
    problems, starts, where = [], [], []
    for name, folds in parts.items():
        for number in folds.predicted:
            out = folds.fold == number
            whiten = posterior.terms.whiten(posterior.noise, posterior.outliers | out)
            for i, fit in enumerate(fits):
                problems.append(LeastSquaresProblem(fit.case, fit.coordinates, readings, whiten))
                starts.append(fit)
                where.append((i, name, out))
    found = descend_together(problems, [f.x for f in starts], [f.linearisation for f in starts])
    means = [{name: np.full(len(readings), np.nan) for name in parts} for _ in fits]
    for (i, name, out), solved in zip(where, found, strict=True):
        if not isinstance(solved, InputError):
            means[i][name][out] = solved.prediction[out]
    return means


def predicted_beside_remainder(node: Explanation, folds: Folds) -> Floats:
    """Predictions (m,) of a part by a node beside its remainder, to first order; NaN outside."""
    mean = np.full(len(folds.fold), np.nan)
    for number in folds.predicted:
        out = folds.fold == number
        given = conditional(node.linear.without(node.outliers | out), node.at)
        mean[out] = (node.fit.prediction + given.expected)[out]
    return mean


@dataclass(frozen=True)
class PredictiveGain:
    """Log density of rows kept back, above that of the soil alone, and its standard error.

    The error is that of a sum over folds that differ by chance; a part that is one fold adds none.
    It is None where every part is one fold, since nothing then tells it.
    """

    value: float
    std_error: float | None = None

    @property
    def is_better(self) -> bool:
        """Whether the rows are predicted better than by the soil alone."""
        return self.value > 0.0


def predictive_gain(
    posterior: Posterior, node: Explanation, parts: Mapping[str, Folds]
) -> PredictiveGain | None:
    """Log density of the rows kept back by a node, above that of the soil alone, mean over parts.

    Both beside their remainders, which are told by all readings, and so is the scatter. Where each
    slip is predicted, its ends are among them, and the region of high slips does not count again.
    None where nothing can be kept back.

    References: Vehtari, Gelman and Gabry, Statistics and Computing 27, 2017, eq. 24 (the sampling
    error).
    """
    counted = sorted(part for part in parts if part != REGION or SLIPS not in parts)
    by_fold = [
        np.asarray(
            [
                posterior.log_density(node, parts[part].fold == number)
                - posterior.log_density(posterior.soil, parts[part].fold == number)
                for number in parts[part].predicted
            ]
        )
        for part in counted
    ]
    if not by_fold:
        return None
    variances = [len(d) * float(np.var(d, ddof=1)) for d in by_fold if len(d) > 1]
    error = float(np.sqrt(sum(variances))) / len(by_fold) if variances else None
    return PredictiveGain(float(np.mean([d.sum() for d in by_fold])), error)


def predictive_gains(
    posterior: Posterior, sets: Sequence[Names], seed: int
) -> dict[Names, PredictiveGain]:
    """How some sets of effects predict rows kept back, beside the soil alone."""
    parts = held_out_folds(posterior.terms.readings, seed)
    found = {}
    for names in sets:
        node = posterior.node_of(names)
        gain = None if node is None else predictive_gain(posterior, node, parts)
        if gain is not None:
            found[names] = gain
    return found
