"""Entries of a report that come from the posterior: soil, effects, candidates, the fitted case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.explanations import CaseExplanation
from soilml.config.measurement_noise import Discrepancy, unestimated_bias
from soilml.config.remainder import Remainder
from soilml.fitting.coordinates import rates_at
from soilml.fitting.least_squares import Solution
from soilml.gap.decision import Decision
from soilml.gap.remainder import discrepancy_amplitudes, learned_remainder
from soilml.gap.results import NamedEffect
from soilml.inference import constants
from soilml.inference.constants import INTERVAL_FACTOR, SCATTER_UNITS
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.numerics.prior import Prior
from soilml.quantities import column
from soilml.report.numbers import round_significant
from soilml.results import EstimatedValue

PRIOR_HALF_WIDTH = 3.0  # Half width of the prior of an effect's size, in standard deviations
WEIGHT_DECIMALS = 4  # Of the weights of explanations in a model file


def stds_of(node: Explanation) -> dict[str, float]:
    """Standard deviations of the parameters of a hypothesis, by path, beside its remainder."""
    covariance = node.linear.evaluate(node.at).covariance
    rates = np.abs(rates_at(node.fit.coordinates, node.fit.x))
    std = INTERVAL_FACTOR * np.sqrt(np.diag(covariance)) * rates
    return dict(zip((c.path for c in node.fit.coordinates), map(float, std), strict=True))


def updated_case(
    node: Explanation,
    discrepancy: dict[str, float] | None = None,
    remainder: Remainder | None = None,
) -> Case:
    """The fitted case: soil and effects at their optimum, with the priors and noise of the input.

    Values are rounded to significant digits.

    The size of each effect gets a uniform prior of three standard deviations to either side, so
    that its uncertainty is propagated where the model is used. `discrepancy` has the standard
    deviations of the smooth discrepancy by column, in the column's unit; None keeps what the case
    declares. An error of a sensor that is fitted as an effect is no longer a bias. `remainder` is
    what the fit leaves and was learned; None keeps that of the case.
    """
    fit, stds = node.fit, stds_of(node)
    values = {path: round_significant(v) for path, v in fit.values().items()}
    case = fit.case.with_values(values)
    prior = dict(fit.case.prior)
    bounds = {path: parameter for path, (parameter, _) in case.parameters().items()}
    for c in fit.coordinates:
        if not c.effect or c.is_shape:
            continue
        value, reach = values[c.path], PRIOR_HALF_WIDTH * stds[c.path]
        lower = max(bounds[c.path].lower, round_significant(value - reach))
        upper = min(bounds[c.path].upper, round_significant(value + reach))
        if lower < upper:
            prior[c.path] = Prior(lower, upper)
    remaining = dict(fit.case.discrepancy)
    if discrepancy is not None:
        declared = next(iter(remaining.values()), Discrepancy())
        remaining = {
            name: replace(declared, share=0.0, constant=round_significant(std), learned=True)
            for name, std in discrepancy.items()
        }
    return replace(
        case,
        prior=prior,
        noise=dict(fit.case.noise),
        discrepancy=remaining,
        bias=unestimated_bias(fit.case.bias, set(fit.effects)),
        remainder=case.remainder if remainder is None else remainder,
    )


def whole_answer(posterior: Posterior, decision: Decision) -> Explanation | None:
    """The only explanation of the returned model; None where it is a mixture of several.

    Effects are the whole answer where they are claimed, the soil alone where that is as likely.
    """
    if decision.claimed and decision.status != "class":
        return decision.shown
    if posterior.no_effect > constants.NAMED_PROBABILITY:
        return next(node for node in posterior.nodes if not node.hypothesis.effects)
    return None


def returned_case(posterior: Posterior, whole: Explanation | None, seed: int) -> Case:
    """What predicts: the case of the whole answer, else the mixture of all that is likely.

    The mixture is of the likeliest explanations that together hold `constants.HELD`. The case
    itself has the mean soil and no effect; each explanation has its own. The smooth remainder is
    that of the mixture.
    """
    parts = likeliest(posterior) if whole is None else [(1.0, whole)]
    left, learned = discrepancy_amplitudes(posterior, parts), learned_remainder(posterior, parts)
    if whole is not None:
        return updated_case(whole, left, learned)
    alone = updated_case(posterior.soil, left, learned)
    mean = {p: round_significant(m.value) for p, m in posterior.soil_marginals(seed).items()}
    each = tuple(
        CaseExplanation.of(round(w, WEIGHT_DECIMALS), updated_case(node)) for w, node in parts
    )
    prior = dict(posterior.problem.case.prior)
    return replace(alone, prior=prior, explanations=each).with_values(mean)


def likeliest(posterior: Posterior) -> list[tuple[float, Explanation]]:
    """The explanations of a mixture, with weights that are not nil in a file."""
    parts: list[tuple[float, Explanation]] = []
    for node in posterior.nodes[: constants.MOST_RETURNED]:
        weight = posterior.node_weight(node)
        if parts and round(weight, WEIGHT_DECIMALS) == 0.0:
            break
        parts.append((weight, node))
        if sum(weight for weight, _ in parts) >= constants.HELD:
            break
    return parts


def soil_before(fit: Solution) -> dict[str, EstimatedValue]:
    """The soil parameters of a fit of the soil alone, by name."""
    values, stds = fit.values(), fit.stds()
    return {c.name: EstimatedValue(values[c.path], stds[c.path], c.unit) for c in fit.coordinates}


def variance_component_entries(posterior: Posterior) -> dict[str, float]:
    """Noise scales, scatter and autocorrelation of the likeliest hypothesis, by their names."""
    terms, at = posterior.terms, posterior.noise
    scales = {
        f"noise_scale_{column(name)}": float(scale)
        for name, scale in zip(terms.readings.channels, terms.noise_scale(at), strict=True)
    }
    angle, bearing = terms.scatter(at)
    return scales | {
        "friction_angle_std": float(angle * SCATTER_UNITS["friction_angle"]),
        "bearing_std": float(bearing * SCATTER_UNITS["bearing"]),
        "autocorrelation": at.autocorrelation,
    }


def named_effects(posterior: Posterior, decision: Decision) -> list[NamedEffect]:
    """The effects of the first claimed set, with those of the other ones."""
    node, best = decision.shown, decision.claimed[0]
    assert node is not None
    alternatives = {n for names in decision.claimed[1:] for n in names} - set(best)
    values, stds = node.fit.values(), stds_of(node)
    return [
        NamedEffect(
            name=name,
            parameters={
                c.name: EstimatedValue(values[c.path], stds[c.path], c.unit)
                for c in node.fit.coordinates
                if c.effect == name
            },
            alternatives=tuple(sorted(alternatives)),
            probability=posterior.probability(name),
            log_odds=posterior.log_odds(name),
        )
        for name in best
    ]
