"""The stage at which the cause of a remainder acts, and what it depends on, where that is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.coordinates import Coordinate
from soilml.gap.held_out import held_out_folds, log_score
from soilml.gap.results import RemainderCause
from soilml.gap.stage_changes import OPERATING, stage_changes
from soilml.inference.constants import IN_CATALOGUE
from soilml.inference.evidence import LinearisedFit, linear_model
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import Hyperparameters
from soilml.inference.posterior import Posterior
from soilml.inference.priors import LOG_2PI, densities_of_amplitude
from soilml.numerics.prior import Prior
from soilml.numerics.smooth_process import process_columns
from soilml.physics.operating_point import COVARIATES

#: Correlation lengths of a change: in slip, in the logarithms of load and of sinkage, and of other
#: quantities as a share of their range. Those of slip and load are those of a discrepancy.
SLIP_LENGTH, LOG_LENGTH, SHARE_OF_RANGE = 0.3, 0.6, 0.5
#: Amplitudes of a change that are tried, in usual ones: steps of a factor of about 1.6, which
#: change -2 ln of the evidence by less than 1 near its maximum; steps of 2.5 change it by 2.
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
    none, found = _weighed(posterior, node)
    stages = _grouped([(one.stage, one.value) for one in found])
    each = (1.0 - NO_STAGE) / max(len(stages), 1)
    prior = {SEVERAL: NO_STAGE, **dict.fromkeys(stages, each)}
    stage, share = _likeliest({SEVERAL: [none], **stages}, prior)
    if stage == SEVERAL or not share > STATED_ODDS / (1.0 + STATED_ODDS):
        return None
    own = [one for one in found if one.stage == stage]
    best = min(own, key=lambda one: one.value)
    gain = _predictive_gain(posterior, node, best, seed)
    if not gain > 0.0:
        return None
    variables = _grouped([(one.variable, one.value) for one in own])
    variable, told = _likeliest(variables, dict.fromkeys(variables, 1.0))
    if not told > VARIABLE_ODDS / (1.0 + VARIABLE_ODDS):
        variable = ""
    probability = IN_CATALOGUE * share  # as of any cause that is stated
    return RemainderCause(stage, variable, probability, gain, node.hypothesis.effects)


def _grouped(pairs: Sequence[tuple[str, float]]) -> dict[str, list[float]]:
    """Values by name."""
    found: dict[str, list[float]] = {}
    for name, value in pairs:
        found.setdefault(name, []).append(value)
    return found


def _likeliest(
    values: Mapping[str, Sequence[float]], prior: Mapping[str, float]
) -> tuple[str, float]:
    """The likeliest group, and its share, by the mean tempered likelihood of its -2 ln p."""
    logs = {
        name: np.logaddexp.reduce(-0.5 * TEMPERING * np.asarray(own))
        + np.log(prior[name] / len(own))
        for name, own in values.items()
    }
    best = max(logs, key=lambda name: logs[name])
    return best, float(np.exp(logs[best] - np.logaddexp.reduce(list(logs.values()))))


def _predictive_gain(
    posterior: Posterior, node: Explanation, best: StageHypothesis, seed: int
) -> float:
    """Log density of rows kept back with the change, above that without; nil without such rows."""
    parts, at = held_out_folds(posterior.terms.readings, seed).values(), best.at
    if not parts or at is None:
        return 0.0
    changed = _beside_changes(posterior, node, best.columns, best.amplitude)
    return log_score(changed, at, parts) - log_score(node.linear, node.at, parts)


def _beside_changes(
    posterior: Posterior, node: Explanation, columns: Floats, amplitude: float
) -> LinearisedFit:
    """The neighbourhood of a fit with changes (m, k), whose weights have this amplitude."""
    weight = Coordinate("change", "1", Prior(0.0, 1.0), normal_std=amplitude)
    extra = [(weight, column) for column in columns.T]
    return linear_model(posterior.terms, node.fit, node.outliers, extra)


def _changes(posterior: Posterior, node: Explanation) -> list[StageHypothesis]:
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


def _weighed(posterior: Posterior, node: Explanation) -> tuple[float, list[StageHypothesis]]:
    """The evidence that no stage is needed, and all changes with theirs.

    Each change is considered beside the discrepancy of the fit, a smaller one, and none. Its
    amplitude has the prior of a discrepancy's.
    """
    found, at, p = _changes(posterior, node), node.at, len(node.fit.x)
    less = np.where(np.arange(len(at.log)) < posterior.terms.channels, np.log(SMALLER), 0.0)
    columns = np.column_stack([one.columns for one in found])
    wide = _beside_changes(posterior, node, columns, 1.0)
    last = p + np.cumsum([one.columns.shape[1] for one in found])
    prior = AMPLITUDES * sum(densities_of_amplitude(AMPLITUDES))
    penalties = -2.0 * np.log(prior / prior.sum())
    none = np.inf
    for pattern in (at, replace(at, log=at.log + less), replace(at, present=False)):
        products, constant = wide.reduced(pattern)
        constant += wide.beside(pattern, node.linear.evaluate(pattern).curvature)
        none = min(none, wide.evidence_with(products, constant, np.arange(p)[None], p)[0].item())
        for i, (one, end) in enumerate(zip(found, last, strict=True)):
            own = range(end - one.columns.shape[1], end)
            values = _by_amplitude(wide, products, constant, p, own) + penalties
            k = int(np.argmin(values))
            if values[k] < one.value:
                best = float(values[k]), pattern, float(AMPLITUDES[k])
                found[i] = replace(one, value=best[0], at=best[1], amplitude=best[2])
    return none, found


def _by_amplitude(
    model: LinearisedFit, products: Floats, constant: float, first: int, changes: Sequence[int]
) -> Floats:
    """Evidence of a model with the weights of some columns at each of `AMPLITUDES`.

    products, constant: By `LinearisedFit.reduced`.
    first: Coordinates before it are always in the model.
    changes: Numbers of the columns, whose weights are normal about zero.

    One eigenvalue problem answers for all amplitudes.
    """
    curvature = products[:first, :first] + np.diag(model.precision[:first])
    curvature += model.information[:first, :first]
    across = products[np.ix_(range(first), changes)]
    own, b = products[np.ix_(changes, changes)], products[:first, -1] - model.pull[:first]
    free, precision = ~model.held[:first], AMPLITUDES[:, None] ** -2
    step = np.linalg.solve(curvature[np.ix_(free, free)], np.column_stack([across, b])[free])
    left, left_b = own - across[free].T @ step[:, :-1], products[changes, -1]
    value, vector = np.linalg.eigh(left)
    gain = (vector.T @ (left_b - across[free].T @ step[:, -1])) ** 2 / (value + precision)
    whole = own - across.T @ np.linalg.solve(curvature, across)
    determinants = np.log(np.linalg.eigvalsh(whole) + precision)
    fixed = products[-1, -1] - b[free] @ step[:, -1] + np.linalg.slogdet(curvature)[1]
    fixed += constant - first * LOG_2PI + model.cost + model.constant[:first].sum()
    return np.asarray(fixed + (determinants - np.log(precision) - gain).sum(axis=1))
