"""Decision: which status the evidence supports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.marginal_likelihood import LARGEST_SIZE
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.report.sentences import NOT_DECISIVE
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.posterior import Names, Posterior, not_rejected
from soilml.gap.search.prediction import PredictiveGain
from soilml.gap.search.stepwise import SearchResult
from soilml.gap.verdict.lookalikes import only_channels
from soilml.quantities import column
from soilml.remarks import Remark

#: Squared deviation of the shapes from the catalogue's law, in prior variances, up to which an
#: effect keeps its name: 2 sigma for one effect. For several effects the limit is lower, because
#: several adjustable laws together fit almost any data.
MAX_SHAPE_DEVIATION, MAX_SHAPE_DEVIATION_SEVERAL = 4.0, 1.0
#: Size of a sensor's or the rig's fault, in prior standard deviations, above which it explains
#: nothing: a gain error of 18 % without calibration.
MAX_SIZE_DEVIATION = 3.0
#: Objective above that of the soil alone up to which an effect is suspected where runs cannot name
#: a cause: tempered odds of 1 to 3, which the report states.
SUSPECT_MARGIN = 4.0
#: Amplitude of a remaining discrepancy, in usual ones, from which the model is wrong in a way that
#: the catalogue lacks (by default 8 % of a range), and the decrease of the objective from which a
#: cause is stated all the same: tempered odds of 1100 to 1.
LARGE_REMAINDER, DECISIVE_GAIN = 4.0, 28.0
#: The same for a name: 5 % of a range, and tempered odds of 270 000 to 1. Where every law of
#: the soil differs from the model's, some effect imitates that best, and a part of the gap stays.
LARGE_BESIDE_NAME, NAME_GAIN = 2.5, 50.0
#: Probability, causes outside the catalogue included, from which a single explanation is named; a
#: smaller one lists it first among the suspects. That of right names lies near `IN_CATALOGUE`.
NAMED_PROBABILITY = 0.9
#: Why an explanation that the evidence supports is not claimed.
IMPLAUSIBLE_FAULT = (
    "{} would explain the gap, but would have to be implausibly large for a fault of a sensor or "
    "of the rig: check that first"
)
IMPLAUSIBLE_SIZE = (
    "{} would have to be far larger than it usually is, so that its law or the cause is another one"
)
NOT_PREDICTIVE = (
    "{} fits the rows, but beside a smooth remainder, it predicts rows that were kept back no "
    "better than the soil alone does"
)
OTHER_LAW = (
    "the law of {} would have to differ much from that of the catalogue, so that the cause may be "
    "one that the catalogue lacks"
)
NOT_CATALOGUED = "beside {}, at least four times the usual error of a model is left in the {}"
LEFT_BESIDE = "beside {}, too large an error of the {} is left for a name: further laws may differ"
#: Why nothing is said where the soil alone is rejected without an alternative.
NOTHING_IS_BETTER = Remark(
    "nothing-is-better", "the soil alone is rejected, and no effect or smooth discrepancy is better"
)


@dataclass(frozen=True)
class Decision:
    """The status, the explanations it claims, and the one whose figures are shown.

    `shown` is the first of the claimed explanations or of the suspects; None where nothing is
    named or suspected. `reason` says why an explanation that the evidence supports is not claimed.
    """

    status: str
    claimed: tuple[Explanation, ...]
    shown: Explanation | None
    reason: Remark | None = None


def decide(
    problem: FitProblem,
    result: SearchResult,
    naming_obstacles: Sequence[Remark],
    disagreements: Sequence[Remark],
) -> Decision:
    """The status of a report; see `soilml.gap.report.results.STATUSES`.

    naming_obstacles: Why these runs cannot identify a cause.
    disagreements: Measurements that disagree with each other, which forbid a verdict without a gap.
    """
    if not result.has_gap:
        return Decision("undecided" if disagreements else "no-gap", (), None)
    if is_left_open(result):
        return Decision("undecided", (), None)
    if naming_obstacles:
        if not _likelier_than_soil_alone(result, SUSPECT_MARGIN):
            return Decision("not-testable", (), None)
        return Decision("suspected", (), _first_suspect(result))
    suspects = _likelier_than_soil_alone(result)
    accepted = result.accepted
    if not accepted or () in {c.names for c in accepted}:
        if not suspects:
            return Decision("unknown", (), None)
        return Decision("suspected", (), _first_suspect(result))
    best = accepted[0]
    if faults := _implausible_faults(best.fit):
        text = IMPLAUSIBLE_FAULT.format(" + ".join(faults))
        return Decision("unknown", (), None, Remark("implausible-fault", text, faults))
    if not suspects:  # many weak rivals share the probability that the soil alone lacks
        return Decision("unknown", (), None)
    not_proven = result.posterior.unlisted | result.posterior.unproven
    if best.names in result.posterior.oversized:
        text = IMPLAUSIBLE_SIZE.format(" + ".join(best.names))
        remark = Remark("implausible-size", text, best.names)
        return Decision("suspected", (), _first_suspect(result), remark)
    if best.names in not_proven:
        text = NOT_PREDICTIVE.format(" + ".join(best.names))
        remark = Remark("not-predictive", text, best.names)
        return Decision("suspected", (), _first_suspect(result), remark)
    not_proven |= result.posterior.oversized
    listed = tuple(c for c in accepted if c.names not in not_proven)
    if _far_from_catalogue(problem, result, best):
        text = OTHER_LAW.format(" + ".join(best.names))
        shown = _first_suspect(result) or best
        return Decision("suspected", (), shown, Remark("other-law", text, best.names))
    if left := _large_remainder(problem, result, best, LARGE_REMAINDER, DECISIVE_GAIN):
        shown = _first_suspect(result) or best
        text = NOT_CATALOGUED.format(" + ".join(best.names), left.replace("_", " "))
        if shown is not best:
            text += f", and the evidence for {' + '.join(shown.names)} is not decisive"
        remark = Remark("not-catalogued", text, (*best.names, column(left)))
        return Decision("suspected", (), shown, remark)
    if len(listed) > 1:
        listed = by_probability(listed, result.posterior)
        return Decision("class", listed, listed[0])
    if len(accepted) > 1 or result.posterior.probability(*best.names) < NAMED_PROBABILITY:
        return Decision("suspected", (), _first_suspect(result) or best, NOT_DECISIVE)
    if left := _large_remainder(problem, result, best, LARGE_BESIDE_NAME, NAME_GAIN):
        text = LEFT_BESIDE.format(" + ".join(best.names), left.replace("_", " "))
        remark = Remark("not-catalogued", text, (*best.names, column(left)))
        return Decision("suspected", (), _first_suspect(result) or best, remark)
    if not result.adequate:
        return Decision("partly-named", accepted, best)
    if best.shape_supported and law_matters(problem, best):
        return Decision("form-open", accepted, best)
    return Decision("named", accepted, best)


def _large_remainder(
    problem: FitProblem, result: SearchResult, best: Explanation, large: float, decisive: float
) -> str:
    """The channel with a large remainder beside an explanation of little evidence, or empty."""
    soil_alone, worst = result.soil_alone, int(np.argmax(best.amplitude))
    if soil_alone is None or soil_alone.objective >= best.objective + decisive:
        return ""
    name = problem.readings.channels[worst]
    return name if best.amplitude[worst] >= large else ""


def _likelier_than_soil_alone(result: SearchResult, margin: float = 0.0) -> bool:
    """Whether an effect describes the data better than the soil alone beside its discrepancy.

    Only effects count that can be suspected.
    """
    likeliest, soil_alone = result.likeliest_suspect, result.soil_alone
    return bool(likeliest and soil_alone and likeliest.objective < soil_alone.objective + margin)


def _first_suspect(result: SearchResult) -> Explanation | None:
    """The candidate that is listed first; see `Posterior.ranked` and `Posterior.from_first`."""
    fitted = {c.names: c for c in result.candidates}
    penalties = {names: c.penalty for names, c in fitted.items()}
    listed = result.posterior.from_first(result.posterior.ranked(), penalties)
    return fitted.get(listed[0][0] if listed else (), result.likeliest_suspect)


def by_probability(
    candidates: Sequence[Explanation], posterior: Posterior
) -> tuple[Explanation, ...]:
    """Explanations in the order of suspects, and the others of the probability of their effects."""
    order = {names: i for i, (names, _) in enumerate(posterior.ranked())}

    def place(c: Explanation) -> tuple[float, int]:
        return -posterior.log_odds(*c.names), order.get(c.names, len(order))

    return tuple(sorted(candidates, key=place))


def is_left_open(result: SearchResult) -> bool:
    """Whether the soil alone is rejected, though no effect and no smooth discrepancy is better.

    The readings then scatter in a way that the estimated noise does not describe.
    """
    soil_alone, likeliest = result.soil_alone, result.likeliest
    if not result.has_gap or soil_alone is None or np.any(soil_alone.amplitude > 0.0):
        return False
    return likeliest is None or soil_alone.objective <= likeliest.objective


def with_refused_outside(
    problem: FitProblem, result: SearchResult, gains: Mapping[Names, PredictiveGain]
) -> SearchResult:
    """The result with refused explanations counted as causes outside the catalogue.

    They need an implausible size or fault, or another law than the catalogue's, or they predict
    rows that were kept back worse than the soil alone does, beyond sampling error. Where a part of
    such a set is accepted, what is refused is its supplement, not that part.

    gains: Log density of the rows kept back, above that of the soil alone, as far as it is known.
    """
    candidates = [c for c in result.candidates if c.names]
    unlisted = {c.names for c in candidates if _implausible_faults(c.fit)}
    unlisted |= {names for names, gain in gains.items() if gain.is_worse}
    unproven = frozenset(names for names, gain in gains.items() if not gain.is_better)
    oversized = {c.names for c in candidates if implausible_sizes(c.fit)} - unlisted
    far = unlisted | oversized
    far |= {c.names for c in candidates if _far_from_catalogue(problem, result, c)}
    parts = [set(c.names) for c in result.accepted if c.names not in far]
    refused = {
        names: frozenset().union(*(part for part in parts if part <= set(names))) for names in far
    }
    found = replace(
        result.posterior,
        refused=refused,
        unlisted=frozenset(unlisted),
        unproven=unproven,
        oversized=frozenset(oversized),
    )
    return replace(result, posterior=found)


def _far_from_catalogue(problem: FitProblem, result: SearchResult, best: Explanation) -> bool:
    """Whether an explanation needs another law than the catalogue's.

    An effect that changes one channel alone is known by its law alone: it needs another one where
    the soil alone, beside its smooth discrepancy, is as likely as the catalogue's law.
    """
    several, soil_alone = len(best.names) > 1, result.soil_alone
    if best.shape_deviation > (MAX_SHAPE_DEVIATION_SEVERAL if several else MAX_SHAPE_DEVIATION):
        return True
    if several or soil_alone is None or not best.shape_supported:
        return False
    by_catalogue = best.catalogue_law.evidence.value + best.penalty
    return by_catalogue >= soil_alone.objective and best.names[0] in only_channels(problem, result)


def _implausible_faults(fit: Solution) -> tuple[str, ...]:
    """Faults of sensors and the rig that are far larger than their priors allow."""
    deviation = np.abs(fit.x) * np.sqrt(fit.precision)
    return tuple(
        c.effect
        for c, d in zip(fit.coordinates, deviation, strict=True)
        if c.effect and not c.is_shape and d > MAX_SIZE_DEVIATION
    )


def implausible_sizes(fit: Solution) -> dict[str, float]:
    """Sizes, in usual ones, of the effects of soil and gear that are far larger, by name."""
    return {
        c.effect: float(abs(x))
        for c, x in zip(fit.coordinates, fit.x, strict=True)
        if c.effect and not c.is_shape and np.isinf(c.std) and abs(x) > LARGEST_SIZE
    }


def reasons(
    decision: Decision, obstacles: Sequence[Remark], disagreements: Sequence[Remark]
) -> tuple[Remark, ...]:
    """Why no cause can be named, or why the absence of a gap is not stated.

    Of the replicate rows that disagree, the worst are named beside the suspects, because no
    suspect explains their difference.
    """
    match decision.status:
        case "undecided":
            return tuple(disagreements)
        case "suspected":
            why = (*obstacles, decision.reason) if decision.reason else tuple(obstacles)
            if not disagreements:
                return why
            worst = disagreements[0]
            text = f"replicate rows disagree: {worst}"
            return (*(why or (NOT_DECISIVE,)), replace(worst, text=text))
        case "not-testable":
            return tuple(obstacles)
    return (decision.reason,) if decision.reason else ()


def cause_set(decision: Decision, result: SearchResult) -> tuple[tuple[str, ...], ...]:
    """The explanations that the data do not reject, where a cause is claimed or suspected."""
    if decision.status == "suspected":
        found, unlisted = result.posterior, result.posterior.unlisted
        kept = [c for c in result.candidates if c.names not in unlisted]
        kept = [c for c in kept if found.favours(c.names, c.penalty)]
        left = by_probability(not_rejected(kept), found)
        first = (decision.shown.names,) if decision.shown else ()
        return tuple(dict.fromkeys((*first, *(c.names for c in left))))
    return tuple(c.names for c in decision.claimed)


def predictive_suspect(decision: Decision, gains: Mapping[Names, PredictiveGain]) -> Names:
    """The effects of the first suspect where it predicts rows kept back better than the soil alone.

    Or of the likeliest of a class. What is wrong with a model and what predicts best are two
    questions: this one is no name.
    """
    if decision.status == "class":
        return decision.claimed[0].names
    if decision.status != "suspected" or decision.shown is None:
        return ()
    gain = gains.get(decision.shown.names)
    return decision.shown.names if gain is not None and gain.is_better else ()


def unclaimed_effects(decision: Decision, result: SearchResult) -> tuple[str, ...]:
    """The likeliest effects where none are claimed."""
    shown = decision.shown or result.likeliest_suspect
    return () if decision.claimed or shown is None else shown.names


#: Difference of the predictions of two laws, as a fraction of a channel's range, below which the
#: law does not matter: that of a usual model error.
NEGLIGIBLE_FRACTION = 0.02


def law_matters(problem: FitProblem, candidate: Explanation) -> bool:
    """Whether the two laws differ inside the measured range by more than matters.

    They differ if, in some channel, the root mean square difference of their predictions exceeds
    both the standard error of a mean over the readings of that channel and the range of the channel
    times `NEGLIGIBLE_FRACTION`.
    """
    readings = problem.readings
    free = candidate.free_law or candidate.catalogue_law
    difference = free.fit.prediction - candidate.catalogue_law.fit.prediction
    for i in range(len(readings.channels)):
        in_channel = readings.channel == i
        values = readings.measured[in_channel]
        if not values.size:
            continue
        rms = float(np.sqrt(np.mean(difference[in_channel] ** 2)))
        mean_error = float(np.sqrt(np.mean(problem.covariance.std[in_channel] ** 2) / values.size))
        span = max(float(values.max()), 0.0) - min(float(values.min()), 0.0)
        if rms > max(mean_error, NEGLIGIBLE_FRACTION * span):
            return True
    return False
