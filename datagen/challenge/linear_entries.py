"""Entries by linearised models: the gap workflow, stepwise regression, and the Lasso."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from datagen.challenge.challenge_files import COLUMNS, NONE, UNKNOWN
from datagen.challenge.house_entries import (
    DRAWS,
    OTHER_CAUSE,
    Answer,
    SetData,
    regression_draws,
    with_other_cause,
)
from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy
from soilml.fitting.coordinates import select_free
from soilml.fitting.covariance import discrepancy_process
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap import gap
from soilml.gap.report.results import GapReport
from soilml.identification import identify
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns
from soilml.physics.effects import EFFECTS

#: Prior standard deviation of the size of an effect, in reference sizes.
WIDE = 3.0
#: Most effects that stepwise regression takes in, and resamples of the rows by the Lasso.
MOST_EFFECTS, RESAMPLES = 3, 50


def gap_entry(data: SetData, seed: int) -> Answer:
    """The gap workflow: its posterior probabilities, and the model that it returns.

    The probability that it leaves is divided between `none` and `unknown`; see
    `gap_probabilities`. Rows kept back are predicted by the model to first order, with its smooth
    error and scatter given all readings.
    """
    report = gap(data.case, data.runs, seed=seed)
    case = replace(report.model, remainder=None)
    readings, runs = data.joined(case)
    jacobian, expected = _linear_soil(case, readings)
    parts = [jacobian, discrepancy_process(readings, case.discrepancy, Discrepancy()).columns]
    found = report.variance_components
    for i, (name, unit) in enumerate(SCATTER_UNITS.items()):
        if size := found.get(f"{name}_std", 0.0) / unit:
            column = size * scatter_columns(case, readings)[:, i]
            of_run = readings.run[readings.row]
            parts.append(
                np.where(of_run[:, None] == np.arange(len(readings.runs)), column[:, None], 0)
            )
    scale = [found.get(f"noise_scale_{name}", 1.0) for name in COLUMNS]
    std = readings.std * np.asarray(scale)[readings.channel]
    rng = np.random.default_rng(seed)
    residual = readings.measured - expected
    draws = regression_draws(np.column_stack(parts), residual, std, runs, DRAWS, rng)
    return Answer(gap_probabilities(report), data.by_row(expected[~runs] + draws))


def gap_probabilities(report: GapReport) -> dict[str, float]:
    """Probabilities of causes, of which one is right, by a report of the gap workflow.

    Those of the catalogue are the report's, scaled down where their sum exceeds what it leaves to
    other causes. The rest is shared by `none`, with the probability of no gap, and by `unknown`.
    All of it is for `none` where the report sees no gap.
    """
    total = sum(report.probabilities.values())
    shrunk = min(1.0, (1.0 - OTHER_CAUSE) / total) if total > 0.0 else 1.0
    left = 1.0 - shrunk * total
    none = 1.0 if report.status == "no-gap" else 1.0 - report.gap_probability
    rest = {NONE: left * none, UNKNOWN: left * (1.0 - none)}
    return {n: shrunk * p for n, p in report.probabilities.items()} | rest


@dataclass(frozen=True)
class LinearModel:
    """A soil-only fit, linearised: readings are `expected` + soil and effects, in noise.

    All are divided by the declared noise: `expected` and `measured` (m,), the columns `soil`
    (m, p), by prior standard deviations, and `effects` (m, k), by reference sizes.
    """

    readings: Readings
    runs: NDArray[np.bool_]
    names: tuple[str, ...]
    expected: Floats
    measured: Floats
    soil: Floats
    effects: Floats

    @staticmethod
    def of(data: SetData) -> LinearModel:
        """Fit the soil to the runs, and linearise soil and effects there."""
        fit = identify(data.case, data.runs, method="nonlinear")
        case = data.case.with_values(dict(zip(fit.names, fit.values.tolist(), strict=True)))
        readings, runs = data.joined(case)
        soil, expected = _linear_soil(case, readings)
        effects = {name: EFFECTS[name] for name in data.causes if name in EFFECTS}
        known, _ = effect_signatures(case, readings, effects)
        columns = np.column_stack([s.column for s in known])
        std = readings.std
        return LinearModel(
            readings,
            runs,
            tuple(s.name for s in known),
            expected / std,
            readings.measured / std,
            soil / std[:, None],
            columns / std[:, None],
        )

    @property
    def residual(self) -> Floats:
        """What the soil leaves, (m,)."""
        return self.measured - self.expected

    def in_units(self, data: SetData, draws: Floats) -> Floats:
        """Draws (d, m_h) over the noise as draws (d, rows, channels) of readings."""
        return data.by_row((self.expected[~self.runs] + draws) * self.readings.std[~self.runs])


def stepwise_entry(data: SetData, seed: int) -> Answer:
    r"""Stepwise least squares over soil and effects by BIC, with an unknown scale of the noise.

    The probability of a cause is that of the model with it alone, and of `none` that without one,
    by their BIC, :math:`p \propto e^{-\mathrm{BIC} / 2}`. Rows kept back are predicted by the model
    that stepwise selection reaches, with the scale that it leaves.

    References: Schwarz, Annals of Statistics 6, 1978; Kass and Raftery, JASA 90, 1995, section 4.1.
    """
    linear = LinearModel.of(data)
    r, soil, effects = (x[linear.runs] for x in (linear.residual, linear.soil, linear.effects))
    chosen: list[int] = []
    best, single = _bic(r, soil), {}
    while len(chosen) < MOST_EFFECTS:
        costs = [
            _bic(r, np.column_stack([soil, effects[:, [*chosen, i]]]))
            for i in range(len(linear.names))
        ]
        if not chosen:
            single = dict(zip((NONE, *linear.names), (best, *costs), strict=True))
        if min(costs) >= best:
            break
        best = min(costs)
        chosen.append(int(np.argmin(costs)))
    least = min(single.values())
    weights = {name: float(np.exp(-0.5 * (bic - least))) for name, bic in single.items()}
    columns = np.column_stack([linear.soil, WIDE * linear.effects[:, chosen]])
    scale = np.full(len(linear.runs), _scale(r, columns[linear.runs]))
    rng = np.random.default_rng(seed)
    draws = regression_draws(columns, linear.residual, scale, linear.runs, DRAWS, rng)
    return Answer(with_other_cause(weights), linear.in_units(data, draws))


def lasso_entry(data: SetData, seed: int) -> Answer:
    """The Lasso on signatures of effects, beside the soil, on resamples of the readings.

    The probability of a cause is the share of the resamples in which it explains most, and of
    `none` that in which no effect is taken in. Each resample predicts the rows kept back.

    References: Tibshirani, J. R. Statist. Soc. B 58, 1996; Bach, Bolasso, ICML 2008.
    """
    linear = LinearModel.of(data)
    rng = np.random.default_rng(seed)
    every = [x[linear.runs] for x in (linear.residual, linear.soil, linear.effects)]
    prior = np.eye(linear.soil.shape[1])  # further rows: the soil is where its prior is
    counts: dict[str, float] = {}
    draws = []
    for _ in range(RESAMPLES):
        drawn = rng.integers(len(every[0]), size=len(every[0]))
        more = (np.zeros(len(prior)), prior, np.zeros((len(prior), len(linear.names))))
        r, soil, effects = (np.concatenate([x[drawn], o]) for x, o in zip(every, more, strict=True))
        basis = np.linalg.qr(soil)[0]
        left = [x - basis @ (basis.T @ x) for x in (effects, r)]
        weights = lasso_weights(*left)
        share = np.abs(weights) * np.linalg.norm(left[0], axis=0)
        name = linear.names[int(np.argmax(share))] if share.max() > 0.0 else NONE
        counts[name] = counts.get(name, 0.0) + 1.0
        of_soil = np.linalg.lstsq(soil, r - effects @ weights, rcond=None)[0]
        scale = max(1.0, float(np.std(r - effects @ weights - soil @ of_soil)))
        mean = linear.soil[~linear.runs] @ of_soil + linear.effects[~linear.runs] @ weights
        each = DRAWS // RESAMPLES
        draws.append(mean + scale * rng.standard_normal((each, len(mean))))
    return Answer(with_other_cause(counts), linear.in_units(data, np.concatenate(draws)))


def lasso_weights(signatures: Floats, residual: Floats) -> Floats:
    """Weights (k,) of signatures (m, k) of residuals (m,) in noise, by the Lasso with BIC."""
    from sklearn.linear_model import LassoLarsIC

    norm = np.maximum(np.linalg.norm(signatures, axis=0), 1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of steps that rounding makes too small
        fitted = LassoLarsIC(criterion="bic", noise_variance=1.0).fit(signatures / norm, residual)
    return np.asarray(fitted.coef_ / norm)


def _linear_soil(case: Case, readings: Readings) -> tuple[Floats, Floats]:
    """Columns (m, p) of the free parameters by prior standard deviations, and predictions (m,)."""
    free = select_free(case, None)
    at = np.asarray([c.prior.fraction(c.nominal) for c in free])
    found = linearise(case, free, np.clip(at, 0.0, 1.0), readings)
    std = np.asarray([c.fraction_precision for c in free]) ** -0.5
    return found.jacobian * std, found.prediction


def _left(r: Floats, columns: Floats) -> float:
    return float(np.sum((r - columns @ np.linalg.lstsq(columns, r, rcond=None)[0]) ** 2))


def _bic(r: Floats, columns: Floats) -> float:
    return float(len(r) * np.log(_left(r, columns) / len(r)) + columns.shape[1] * np.log(len(r)))


def _scale(r: Floats, columns: Floats) -> float:
    return float(np.sqrt(_left(r, columns) / max(len(r) - columns.shape[1], 1)))
