"""The stage at which the cause of a remainder acts, and what it depends on, where that is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.covariance import DiscrepancyProcess
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.held_out import Folds, held_out_folds
from soilml.gap.evidence.linearised_fit import AMPLITUDES, ProcessDivisions
from soilml.gap.evidence.marginal_likelihood import TEMPERING, DiscrepancyModel, linearised
from soilml.gap.evidence.problem import FitProblem, MarginalFit
from soilml.gap.evidence.stage_changes import stage_changes
from soilml.gap.report.remainder_cause import RemainderCause
from soilml.gap.search.posterior import IN_CATALOGUE
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.smooth_process import process_columns
from soilml.physics.operating_point import COVARIATES

#: Correlation lengths of a change: in slip, in the logarithms of load and of sinkage, and of other
#: quantities as a share of their range. Those of slip and load are those of a discrepancy.
SLIP_LENGTH, LOG_LENGTH, SHARE_OF_RANGE = 0.3, 0.6, 0.5
#: Usual size of a change of one channel, as a share of its prediction.
USUAL_GAIN = 0.05
#: Odds of a stage against all others together, from which it is stated, and of a dependence.
STATED_ODDS, VARIABLE_ODDS = 10.0, 3.0
#: Prior probability that the remainder has no single stage.
NO_STAGE = 0.5
#: What an error of slip or load may depend on: they are not measured in the contact.
OPERATING, OF_OPERATION = "slip or load", ("slip", "load", "slip and load", "progress")
#: Change of a channel, in its noise, from which it is said to share the cause.
NOTICED = 0.5
SEVERAL = "several causes"


@dataclass(frozen=True)
class Hypothesis:
    """A change at one stage that is a smooth function of one variable.

    columns: Changes (m, k) of the readings with k independent standard normal weights.
    value: -2 ln of the evidence, up to a constant that all share.
    """

    stage: str
    what: str
    variable: str
    columns: Floats
    value: float = np.inf
    amplitude: tuple[float, ...] = ()


def described_cause(problem: FitProblem, marginal: MarginalFit, seed: int) -> RemainderCause | None:
    r"""The stage of the cause of the remainder beside a fit; None where the readings do not tell.

    Each change g of a stage, and each change of one channel, is multiplied by a smooth function h
    of one variable v, or of slip and load, whose amplitude is free:

    .. math:: y = f(x) + h(v) \, g + \delta + e, \quad h \sim GP(0, \tau^2 k)

    beside the smooth discrepancy :math:`\delta` of each channel, noise and scatter e. Soil and
    effects x are fitted with it to first order. A stage is stated if its tempered probability
    is ten times that of all others and of several causes together, and if it predicts rows kept
    back better than a discrepancy of each channel alone does. Only one change is considered at a
    time; with readings of one channel, or at several slip angles, no stage is stated.

    References: Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2; MacKay, Neural
    Computation 4(3), 1992, section 2 (the evidence); Vehtari and Ojanen, Statistics Surveys 6,
    2012, section 2 (the log score).
    """
    fit = marginal.fit
    if not marginal.evidence.amplitude.any() or len(problem.readings.channels) < 2:
        return None
    angle = problem.readings.at.slip_angle
    if angle is not None and np.ptp(angle) > 0.0:  # no change here turns the shear stress aside
        return None
    if not np.isfinite([*fit.prediction, *fit.linearisation.log_sinkage]).all():
        return None
    none, found = weighed(problem, marginal)
    stage, probability = likeliest_stage(none, found)
    if not probability > STATED_ODDS / (1.0 + STATED_ODDS):
        return None
    own = [one for one in found if one.stage == stage]
    best = min(own, key=lambda one: one.value)
    gain = _predictive_gain(problem, marginal, best, seed)
    if not gain > 0.0:
        return None
    variable, share = _likeliest(
        {v: [one.value for one in own if one.variable == v] for v in {o.variable for o in own}}
    )
    told = share > VARIABLE_ODDS / (1.0 + VARIABLE_ODDS)
    channels = _changed_channels(problem, fit, best)
    probability *= IN_CATALOGUE  # as of any cause that is stated
    beside = tuple(dict.fromkeys(c.effect for c in fit.coordinates if c.effect))
    return RemainderCause(stage, variable if told else "", channels, probability, gain, beside)


def likeliest_stage(none: float, found: Sequence[Hypothesis]) -> tuple[str, float]:
    """The stage of largest probability, and that.

    Several causes together, which have the probability `NO_STAGE` beforehand, are no stage: where
    they are likeliest, the probability is zero.
    """
    values = {s: [one.value for one in found if one.stage == s] for s in {o.stage for o in found}}
    if not values:
        return SEVERAL, 0.0
    logs = {s: _log_mean(v) + np.log((1.0 - NO_STAGE) / len(values)) for s, v in values.items()}
    logs[SEVERAL] = _log_mean([none]) + float(np.log(NO_STAGE))
    return _normalised(logs)


def _likeliest(values: Mapping[str, Sequence[float]]) -> tuple[str, float]:
    return _normalised({name: _log_mean(own) for name, own in values.items()})


def _normalised(logs: Mapping[str, float]) -> tuple[str, float]:
    weights = {name: float(np.exp(own - max(logs.values()))) for name, own in logs.items()}
    best = max(weights, key=lambda name: weights[name])
    if best == SEVERAL:
        return best, 0.0
    return best, weights[best] / sum(weights.values())


def _log_mean(values: Sequence[float]) -> float:
    """Logarithm of the mean tempered likelihood of values of -2 ln p."""
    logs = -0.5 * TEMPERING * np.asarray(values)
    return float(logs.max() + np.log(np.mean(np.exp(logs - logs.max()))))


def _predictive_gain(
    problem: FitProblem, marginal: MarginalFit, best: Hypothesis, seed: int
) -> float:
    """Log density of rows kept back with the change, above that without; nil without such rows."""
    parts = held_out_folds(problem.readings, seed)
    if not parts:
        return 0.0
    fit, amplitude = marginal.fit, marginal.evidence.amplitude
    without = log_score(problem, fit, problem.discrepancy, amplitude, parts)
    own = np.asarray(best.amplitude)
    having = log_score(problem, fit, with_change(problem, best), own, parts)
    return float(np.mean([having[name] - without[name] for name in parts]))


def _changed_channels(problem: FitProblem, fit: Solution, best: Hypothesis) -> tuple[str, ...]:
    """Channels that the change moves by more than `NOTICED`, root mean square in their noise."""
    model, own = with_change(problem, best), np.asarray(best.amplitude)
    size = own[-1] * best.columns
    matrix = model.matrix(own) + fit.derivatives @ fit.derivatives.T / UNIFORM_PRECISION
    residual = problem.readings.measured - fit.prediction
    moved = size @ (size.T @ np.linalg.solve(matrix, residual)) / problem.covariance.std
    channel = problem.readings.channel
    return tuple(
        name
        for i, name in enumerate(problem.readings.channels)
        if np.sqrt(np.mean(moved[channel == i] ** 2)) > NOTICED
    )


def hypotheses(problem: FitProblem, fit: Solution) -> list[Hypothesis]:
    """All changes of stages and of single channels, by what they may depend on."""
    readings, usual = problem.readings, problem.discrepancy.process.usual
    variables = _variables(problem, fit)
    found = []
    for change in stage_changes(fit.fitted(), readings):
        if change.along:
            found.append(Hypothesis(change.stage, change.what, change.along, change.columns))
            continue
        for name, columns in variables.items():
            if change.stage != OPERATING or name in OF_OPERATION:
                own = change.columns * columns
                found.append(Hypothesis(change.stage, change.what, name, own))
    for i, channel in enumerate(readings.channels):
        own = readings.channel == i
        gain = np.where(own, USUAL_GAIN * fit.prediction, 0.0)
        added = np.where(own, usual[i], 0.0)
        for name, columns in variables.items():
            found.append(Hypothesis(channel, "gain", name, gain[:, None] * columns))
            found.append(Hypothesis(channel, "added", name, added[:, None] * columns))
    return found


def _variables(problem: FitProblem, fit: Solution) -> dict[str, Floats]:
    """Columns (m, k) of a unit process of each variable that varies in the readings."""
    readings = problem.readings
    slip, load = readings.slip / SLIP_LENGTH, np.log(readings.load) / LOG_LENGTH
    sinkage = fit.linearisation.log_sinkage[readings.row] / LOG_LENGTH
    points = {"slip": slip, "load": load, "sinkage": sinkage}
    for field in COVARIATES:
        value = getattr(readings.at, field)
        if value is None or field == "load_direction":
            continue
        own = np.broadcast_to(np.asarray(value, np.float64), readings.run.shape)[readings.row]
        if np.ptp(own) > 0.0:
            points[field] = own / (SHARE_OF_RANGE * np.ptp(own))
    found = {name: process_columns(own[:, None]) for name, own in points.items()}
    found["slip and load"] = process_columns(np.column_stack([slip, load]))
    return {name: own for name, own in found.items() if own.shape[1] > 1}


def weighed(problem: FitProblem, marginal: MarginalFit) -> tuple[float, list[Hypothesis]]:
    """The evidence that no stage is needed, and all hypotheses with theirs."""
    base, fit, best = problem.discrepancy, marginal.fit, marginal.evidence.amplitude
    count = len(base.process.usual)
    patterns = [best, np.zeros(count), AMPLITUDES[np.searchsorted(AMPLITUDES, 0.4 * best)]]
    alone = linearised(base, fit)
    none = min(float(alone.along(p, i).min()) for p in patterns for i in range(count))
    whiten = base.noise_whitening
    block = whiten @ np.column_stack([fit.derivatives, fit.measured - fit.prediction])
    found = []
    for one in hypotheses(problem, fit):
        own = np.asarray(whiten @ one.columns)
        between = base.columns.T @ own
        gram = np.block([[alone.divisions.gram, between], [between.T, own.T @ own]])
        number = np.append(base.process.channel, np.full(own.shape[1], count))
        local = replace(
            alone,
            divisions=ProcessDivisions(gram, number, alone.divisions),
            cross=np.vstack([alone.cross, own.T @ block]),
        )
        trials = []
        for p in patterns:
            values = local.along(np.append(p, 0.0), count)
            k = 1 + int(np.argmin(values[1:]))
            trials.append((float(values[k]), (*p.tolist(), float(AMPLITUDES[k]))))
        value, amplitude = min(trials)
        found.append(replace(one, value=value, amplitude=amplitude))
    return none, found


def with_change(problem: FitProblem, one: Hypothesis) -> DiscrepancyModel:
    """Noise, scatter, a discrepancy of each channel, and the change, as if it were a channel."""
    process = problem.discrepancy.process
    number = np.full(one.columns.shape[1], len(process.usual))
    return DiscrepancyModel(
        problem.covariance,
        DiscrepancyProcess(
            np.column_stack([process.columns, one.columns]),
            np.concatenate([process.channel, number]),
            np.append(process.usual, 1.0),
        ),
    )


def log_score(
    problem: FitProblem,
    fit: Solution,
    model: DiscrepancyModel,
    amplitude: Floats,
    parts: Mapping[str, Folds],
) -> dict[str, float]:
    """Log density of rows kept back, by part; the soil is fitted to the rest to first order."""
    tests = fit.soil_tests.rates(fit.x)
    prior = np.diag(fit.precision + UNIFORM_PRECISION) + tests.T @ tests
    matrix = model.matrix(amplitude) + fit.derivatives @ np.linalg.solve(prior, fit.derivatives.T)
    precision = np.asarray(np.linalg.inv(matrix), np.float64)
    weighted = precision @ (problem.readings.measured - fit.prediction)
    return {
        name: sum(_density(precision, weighted, folds.fold == k) for k in folds.predicted)
        for name, folds in parts.items()
    }


def _density(precision: Floats, weighted: Floats, out: NDArray[np.bool_]) -> float:
    r"""Log density of the residuals that are kept back, given the others, up to a constant.

    .. math:: -\tfrac12 (P r)_o^T P_{oo}^{-1} (P r)_o + \tfrac12 \ln |P_{oo}|

    with the precision P of all residuals r: one inverse serves all folds. References: Rasmussen and
    Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.12, for several readings.
    """
    factor = np.linalg.cholesky(precision[np.ix_(out, out)])
    white = np.linalg.solve(factor, weighted[out])
    return float(-0.5 * white @ white + np.log(np.diag(factor)).sum())
