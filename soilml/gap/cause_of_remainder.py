"""The stage at which the cause of a remainder acts, and what it depends on, where that is told."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.gap.held_out import held_out_folds
from soilml.gap.results import RemainderCause
from soilml.gap.stage_changes import OPERATING, stage_changes
from soilml.inference.constants import IN_CATALOGUE, UNKNOWN_CAUSE, UNKNOWN_SCALE
from soilml.inference.evidence import LinearisedFit
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import FIXED, Hyperparameters
from soilml.inference.posterior import Posterior
from soilml.numerics.smooth_process import process_columns
from soilml.physics.operating_point import COVARIATES

#: Correlation lengths of a change: in slip, in the logarithms of load and of sinkage, and of other
#: quantities as a share of their range. Those of slip and load are those of a discrepancy.
SLIP_LENGTH, LOG_LENGTH, SHARE_OF_RANGE = 0.3, 0.6, 0.5
#: Amplitudes of a change that are tried, in usual ones: steps of a factor of about 1.6, which
#: change the evidence by less than 1 near its maximum.
AMPLITUDES = np.asarray([0.15, 0.25, 0.4, 0.6, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0, 16.0, 25.0])
#: Factor on differences of the evidence: amplitudes at their maximum overstate it.
TEMPERING = 0.5
#: Amplitude of a discrepancy, relative to that beside the fit, that a change may leave.
SMALLER = 0.4
#: Usual size of a change of one channel, as a share of its prediction.
USUAL_GAIN = 0.05
#: Odds of a stage against all others together, from which it is stated, and of a dependence.
STATED_ODDS, VARIABLE_ODDS = 10.0, 3.0
#: Prior probability that the remainder has no single stage.
NO_STAGE = 0.5
#: What an error of slip or load may depend on: they are not measured in the contact.
OF_OPERATION = ("slip", "load", "slip and load", "progress")
SEVERAL = "several causes"


def _amplitude_penalty() -> Floats:
    """-2 ln of the prior probability of each of `AMPLITUDES`: that of a discrepancy's."""
    edges = np.concatenate([[0.0], np.sqrt(AMPLITUDES[1:] * AMPLITUDES[:-1]), [np.inf]])
    usual, unknown = 1.0 - np.exp(-edges), 2.0 / np.pi * np.arctan(edges / UNKNOWN_SCALE)
    mass = np.diff((1.0 - UNKNOWN_CAUSE) * usual + UNKNOWN_CAUSE * unknown)
    return np.asarray(-2.0 * np.log(mass))


AMPLITUDE_PENALTY = _amplitude_penalty()


@dataclass(frozen=True)
class StageHypothesis:
    """A change at one stage that is a smooth function of one variable."""

    stage: str
    variable: str
    columns: Floats  # changes (m, k) of the readings with k independent standard normal weights
    value: float = np.inf  # -2 ln of the evidence, up to a constant that all share
    at: Hyperparameters | None = None
    amplitude: float = 0.0


def described_cause(posterior: Posterior, node: Explanation, seed: int) -> RemainderCause | None:
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
    readings, fit = posterior.terms.readings, node.fit
    if not node.at.present or len(readings.channels) < 2:
        return None
    angle = readings.at.slip_angle
    if angle is not None and np.ptp(angle) > 0.0:  # no change here turns the shear stress aside
        return None
    if not np.isfinite([*fit.prediction, *fit.linearisation.log_sinkage]).all():
        return None
    none, found = weighed(posterior, node)
    stage, probability = likeliest_stage(none, found)
    if not probability > STATED_ODDS / (1.0 + STATED_ODDS):
        return None
    own = [one for one in found if one.stage == stage]
    best = min(own, key=lambda one: one.value)
    gain = _predictive_gain(posterior, node, best, seed)
    if not gain > 0.0:
        return None
    variables = dict.fromkeys(one.variable for one in own)
    logs = {v: _log_mean(one.value for one in own if one.variable == v) for v in variables}
    variable, share = _normalised(logs)
    told = share > VARIABLE_ODDS / (1.0 + VARIABLE_ODDS)
    probability *= IN_CATALOGUE  # as of any cause that is stated
    beside = node.hypothesis.effects
    return RemainderCause(stage, variable if told else "", probability, gain, beside)


def likeliest_stage(none: float, found: Sequence[StageHypothesis]) -> tuple[str, float]:
    """The stage of largest probability, and that.

    Several causes together, which have the probability `NO_STAGE` beforehand, are no stage: where
    they are likeliest, the probability is zero.
    """
    stages = dict.fromkeys(one.stage for one in found)
    if not stages:
        return SEVERAL, 0.0
    each = np.log((1.0 - NO_STAGE) / len(stages))
    logs = {s: _log_mean(one.value for one in found if one.stage == s) + each for s in stages}
    best, share = _normalised({SEVERAL: _log_mean([none]) + np.log(NO_STAGE), **logs})
    return best, 0.0 if best == SEVERAL else share


def _normalised(logs: Mapping[str, float]) -> tuple[str, float]:
    """The likeliest by logarithms of probabilities, and its share."""
    best = max(logs, key=lambda name: logs[name])
    return best, 1.0 / sum(float(np.exp(own - logs[best])) for own in logs.values())


def _log_mean(values: Iterable[float]) -> float:
    """Logarithm of the mean tempered likelihood of values of -2 ln p."""
    logs = -0.5 * TEMPERING * np.asarray(list(values))
    return float(np.logaddexp.reduce(logs) - np.log(len(logs)))


def _predictive_gain(
    posterior: Posterior, node: Explanation, best: StageHypothesis, seed: int
) -> float:
    """Log density of rows kept back with the change, above that without; nil without such rows."""
    parts = held_out_folds(posterior.terms.readings, seed).values()
    assert best.at is not None
    changed, at = _with_change(node.linear, best), best.at
    sums = [
        sum(
            _log_density(changed, at, folds.fold == k)
            - _log_density(node.linear, node.at, folds.fold == k)
            for k in folds.predicted
        )
        for folds in parts
    ]
    return float(np.mean(sums)) if sums else 0.0


def _log_density(model: LinearisedFit, at: Hyperparameters, out: NDArray[np.bool_]) -> float:
    """Log density of the readings that are kept back, given the others."""
    rest = model.without(model.outliers | out)
    return -0.5 * (model.evaluate(at).value - rest.evaluate(at).value)


def _with_change(model: LinearisedFit, one: StageHypothesis) -> LinearisedFit:
    """The model with a change of a stage, at its likeliest amplitude."""
    terms = model.terms
    columns = np.column_stack([terms.columns, one.amplitude * one.columns])
    group = np.append(terms.group, np.full(one.columns.shape[1], FIXED))
    return replace(
        model, terms=replace(terms, columns=columns, group=group, _kept={}), _products={}, _taken={}
    )


def hypotheses(posterior: Posterior, node: Explanation) -> list[StageHypothesis]:
    """All changes of stages and of single channels, by what they may depend on."""
    readings, usual, fit = posterior.terms.readings, posterior.terms.usual, node.fit
    variables = _variables(posterior, node)
    found = []
    for stage, change in stage_changes(fit.fitted(), readings):
        found += [
            StageHypothesis(stage, name, change[:, None] * columns)
            for name, columns in variables.items()
            if stage != OPERATING or name in OF_OPERATION
        ]
    for i, channel in enumerate(readings.channels):
        own = readings.channel == i
        for name, columns in variables.items():
            for size in (USUAL_GAIN * fit.prediction, usual[i]):  # a gain, or what is added
                found.append(
                    StageHypothesis(channel, name, np.where(own, size, 0.0)[:, None] * columns)
                )
    return found


def _variables(posterior: Posterior, node: Explanation) -> dict[str, Floats]:
    """Columns (m, k) of a unit process of each variable that varies in the readings."""
    readings, fit = posterior.terms.readings, node.fit
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


def weighed(posterior: Posterior, node: Explanation) -> tuple[float, list[StageHypothesis]]:
    """The evidence that no stage is needed, and all hypotheses with theirs.

    Each change is considered beside the discrepancy of the fit, a smaller one, and none.
    """
    found, at = hypotheses(posterior, node), node.at
    less = np.where(np.arange(len(at.log)) < posterior.terms.channels, np.log(SMALLER), 0.0)
    patterns = [at, replace(at, log=at.log + less), replace(at, present=False)]
    model, p = node.linear, len(node.fit.x)
    columns = np.column_stack([model.jacobian, *(one.columns for one in found)])
    wide = replace(model, jacobian=columns, x=np.zeros(columns.shape[1]), _products={}, _taken={})
    starts = p + np.cumsum([0, *(one.columns.shape[1] for one in found)])
    values = np.full((len(found), len(patterns), len(AMPLITUDES)), np.inf)
    none = np.inf
    for j, pattern in enumerate(patterns):
        products, constant = wide.reduced(pattern)
        constant += model.beside(pattern, model.evaluate(pattern).curvature)
        plain = np.append(np.arange(p), -1)
        none = min(
            none, float(_evidence(model, products[np.ix_(plain, plain)][None])[0] + constant)
        )
        for i in range(len(found)):
            own = np.arange(starts[i], starts[i + 1])
            size, vector = np.linalg.eigh(products[np.ix_(own, own)])
            rotated = vector.T @ products[np.ix_(own, plain)]
            square = AMPLITUDES[:, None] ** 2
            growth = square * np.maximum(size, 0.0)
            shrink = square / (1.0 + growth)
            left = products[np.ix_(plain, plain)] - (shrink[:, None, :] * rotated.T) @ rotated
            value = _evidence(model, left) + constant + np.log1p(growth).sum(axis=1)
            values[i, j] = value + AMPLITUDE_PENALTY
    weighed_ = []
    for one, each in zip(found, values, strict=True):
        j, k = divmod(int(np.argmin(each)), len(AMPLITUDES))
        amplitude = float(AMPLITUDES[k])
        weighed_.append(replace(one, value=float(each[j, k]), at=patterns[j], amplitude=amplitude))
    return none, weighed_


def _evidence(model: LinearisedFit, products: Floats) -> Floats:
    """-2 ln p (b,) with the coordinates integrated out, from products (b, p + 1, p + 1)."""
    p, free = len(model.x), ~model.held
    curvature = products[:, :p, :p] + np.diag(model.precision) + model.information
    gradient = np.where(free, products[:, :p, p] - model.pull, 0.0)
    moving = np.where(free[:, None] & free, curvature, np.eye(p))
    step = np.linalg.solve(moving, gradient[..., None])[..., 0]
    gain = (gradient * step).sum(axis=1)
    return np.asarray(products[:, p, p] - gain + np.linalg.slogdet(curvature)[1])
