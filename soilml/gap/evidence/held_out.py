"""Prediction of rows that were kept back, by refits of explanations to all other rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.covariance import Whitening
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.readings import Readings
from soilml.gap.evidence.marginal_likelihood import WEAK_PRECISION
from soilml.gap.evidence.problem import FitProblem
from soilml.numerics.prior import UNIFORM_PRECISION

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


@dataclass(frozen=True)
class HeldOutPrediction:
    """Predictions of the readings of one part, each by a fit to all readings outside its fold.

    `log_densities` are the logarithms of the probability density of each fold's readings, with the
    variance of noise, scatter, remainder and parameters.
    """

    mean: Floats  # (m,), NaN outside the part and without equilibrium
    std: Floats  # (m,) of a reading, NaN outside the part
    log_densities: tuple[float, ...] = ()

    @property
    def log_density(self) -> float:
        """The logarithm of the density of all readings of the part."""
        return sum(self.log_densities)


def predict_parts(
    problem: FitProblem, models: Sequence[tuple[Solution, Floats]], parts: Mapping[str, Folds]
) -> list[dict[str, HeldOutPrediction]]:
    r"""Predict all parts by each of several models, which are refitted without each fold.

    .. math::
        y_o \sim N(f_o + A (y_r - f_r),\; V_{oo} - A V_{ro} + B \Sigma B^T), \quad
        A = V_{or} V_{rr}^{-1}, \quad B = J_o - A J_r

    with the covariance V of noise, scatter and remainder, the predictions f and derivatives J of
    the fit to the rest r, and the covariance of its coordinates. All fits share the calls of the
    model. A fold without a fit counts as ten standard deviations away.

    models: Fits to all readings, from which the refits start, with the amplitudes of the smooth
        remainder by channel; zero for fits under noise and scatter alone.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.25,
    2.26 and 2.41.
    """
    readings = problem.readings
    problems, starts, where = [], [], []
    for name, folds in parts.items():
        for number in folds.predicted:
            rest = folds.fold != number
            known = problem.discrepancy.of_readings(rest, readings.run[readings.row])
            for i, (fit, amplitude) in enumerate(models):
                whiten = of_selected(known.whiten(amplitude), rest)
                problems.append(LeastSquaresProblem(fit.case, fit.coordinates, readings, whiten))
                starts.append(fit)
                where.append((i, name, rest))
    fits = descend_together(
        problems, [fit.x for fit in starts], [fit.linearisation for fit in starts]
    )
    covariance = [problem.discrepancy.matrix(amplitude) for _, amplitude in models]
    found = [{name: _nothing_yet(len(readings)) for name in parts} for _ in models]
    for (i, name, rest), solved in zip(where, fits, strict=True):
        part = found[i][name]
        if isinstance(solved, InputError):
            std = problem.covariance.std[~rest]
            part.std[~rest], log_density = std, _density_of_nothing(std)
        else:
            part.mean[~rest], part.std[~rest], log_density = _conditional(
                solved, readings.measured, covariance[i], rest
            )
        found[i][name] = replace(part, log_densities=(*part.log_densities, log_density))
    return found


def of_selected(whiten: Whitening, selected: NDArray[np.bool_]) -> Whitening:
    """What whitens selected readings out of m, for arrays (m,) and (m, k) of all of them."""
    noise = whiten.noise  # sparse: its columns become those of the selected readings
    parts = noise.data, np.flatnonzero(selected)[noise.indices], noise.indptr
    return replace(whiten, noise=type(noise)(parts, shape=(noise.shape[0], len(selected))))


def _nothing_yet(count: int) -> HeldOutPrediction:
    return HeldOutPrediction(np.full(count, np.nan), np.full(count, np.nan))


def _conditional(
    fit: Solution, reading: Floats, matrix: Floats, rest: NDArray[np.bool_]
) -> tuple[Floats, Floats, float]:
    """Mean and standard deviation of readings that are not in the rest, and their log density."""
    out, prediction, jacobian = ~rest, fit.prediction, fit.derivatives
    gain = np.linalg.solve(matrix[np.ix_(rest, rest)], matrix[np.ix_(rest, out)]).T
    left = np.nan_to_num(reading[rest] - prediction[rest])
    mean = prediction[out] + gain @ left
    change = jacobian[out] - gain @ jacobian[rest]
    covariance = matrix[np.ix_(out, out)] - gain @ matrix[np.ix_(rest, out)]
    covariance = covariance + change @ _coordinate_covariance(fit) @ change.T
    std = np.sqrt(np.diag(covariance))
    if not np.isfinite(mean).all():
        return mean, std, _density_of_nothing(std)
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, reading[out] - mean)
    log_density = -0.5 * float(white @ white + np.log(2.0 * np.pi) * len(white))
    return mean, std, log_density - float(np.log(np.diag(factor)).sum())


def _coordinate_covariance(fit: Solution) -> Floats:
    """Covariance (p, p) of coordinates whose priors are as wide as they are."""
    wide = [WEAK_PRECISION if c.effect else UNIFORM_PRECISION for c in fit.coordinates]
    wide = [own if np.isinf(c.std) else 0.0 for own, c in zip(wide, fit.coordinates, strict=True)]
    jacobian = np.vstack([fit.jacobian, fit.soil_tests.rates(fit.x)])
    information = jacobian.T @ jacobian + np.diag(fit.precision + np.asarray(wide))
    return np.asarray(np.linalg.inv(information))


def _density_of_nothing(std: Floats) -> float:
    """Log density of readings that are not predicted: each is ten standard deviations away."""
    each = INFEASIBLE_SQUARE + np.log(2.0 * np.pi * std**2)
    return -0.5 * float(each.sum())
