"""The analysis: a search within the priors of the soil, and beyond them where that matters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.readings import Readings
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.opened_priors import open_priors
from soilml.gap.search.passes import (
    Analysis,
    Begun,
    begin,
    declared_covariance,
    of_readings,
    with_singles,
)
from soilml.gap.search.prediction import predict_with, predictive_gains
from soilml.gap.search.residual_test import residual_test
from soilml.gap.search.screening import Singles
from soilml.gap.search.stepwise import GAP_LEVEL, is_complete, without_search
from soilml.gap.search.without_outliers import without_outliers
from soilml.physics.effects.base import Effect

#: Code of the remark that no effect is needed where the priors of the soil are opened.
OUTSIDE_PRIORS = "soil-outside-priors"
#: Decrease of the objective from which an analysis with opened priors replaces the one with those
#: of the case: tempered odds of 1 to 9. It then names suspects only.
OPENED_MARGIN = 9.0
#: The same where less than half the remainder is left. Its evidence may then be a little smaller:
#: wider priors cost evidence, and what a large remainder takes up is not explained.
NO_MARGIN = -6.0
#: What may be missing of either where all likely single effects are then fitted too.
NEARLY = 10.0


def analyse(
    case: Case,
    free: Sequence[Coordinate],
    readings: Readings,
    effects: Mapping[str, type[Effect]],
    calibration: Mapping[str, float],
    seed: int,
    place: Callable[[int], str],
    progress: Callable[[float], None],
) -> Analysis:
    """Search for the effects that explain what the soil alone does not.

    Where the soil presses against its priors, the search is repeated with these opened; it counts
    where it explains the readings far better, which a first look tells. Where
    the soil alone then leaves no gap, that speaks against a cause.

    `place` gives the file and line of a row, for messages; `progress` is called with the share that
    is done.
    """
    problem = FitProblem(
        case=case,
        soil=tuple(free),
        readings=readings,
        covariance=declared_covariance(readings),
        effects=effects,
        calibration=calibration,
    )
    found = without_outliers(problem, seed, place, progress)
    if not found.error:
        found = replace(found, predictions=predict_with(found.problem, found.result, seed))
        opened = open_priors(found.problem, found.result)
        if opened is not None:
            start = replace(problem, case=opened.case, soil=opened.soil)
            begun = _begun_beyond(found, start, seed, place)
            other, _ = begun
            better = any(explains_better(found, other, c) for c in other.result.candidates)
            if better or not other.result.has_gap:
                other = without_outliers(start, seed, place, progress, found, begun)
            if any(explains_better(found, other, c) for c in other.result.candidates):
                other = replace(other, predictions=predict_with(other.problem, other.result, seed))
                likeliest = _predictive(other)
                if likeliest is not None and explains_better(found, other, likeliest):
                    within = found.result.soil
                    found = replace(other, opened=opened.remark, within_priors=within)
            elif not (other.error or other.outliers or other.result.has_gap):
                text = f"{opened.remark}. The soil alone then agrees with the rows"
                remark = replace(opened.remark, code=OUTSIDE_PRIORS, text=text)
                found = _explained_by_soil(replace(found, opened=remark), seed)
    return found


def _begun_beyond(
    found: Analysis, start: FitProblem, seed: int, place: Callable[[int], str]
) -> Begun:
    """A first look with opened priors, which tells whether they can count.

    If no effect explains far more in it, sets of several seldom do. None explains more than one
    alone that leaves nothing within the priors; then the soil alone is tested. Else the likeliest
    sets are fitted first and, where more parameters are fitted than before, the first single
    effects. All likely ones are fitted only if one of these nearly counts.

    start: The problem of all readings, with opened priors.
    """
    kept = start if found.excluded is None else of_readings(start, ~found.excluded)
    rival = _rival(found)
    if len(rival.names) == 1 and is_complete(found.problem, rival, found.result, seed):
        return begin(kept, seed, place, found.result, singles="none")
    singles: Singles = "first" if len(start.soil) > len(found.problem.soil) else "none"
    begun = begin(kept, seed, place, found.result, likeliest=True, singles=singles)
    first = begun[0]
    nearly = any(explains_better(found, first, c, NEARLY) for c in first.result.candidates)
    return with_singles(begun, seed) if nearly else begun


def _explained_by_soil(found: Analysis, seed: int) -> Analysis:
    """An analysis whose gap a soil outside the priors explains, without a search if it is all.

    The gap is then one within the priors alone: what doubts them is no evidence of an effect.
    """
    result = found.result
    signatures = result.soil_test.signatures
    test = residual_test(found.problem, result.soil, signatures, seed)
    if test.p_value < GAP_LEVEL:
        return found
    result = without_search(result.soil, test, result.untestable)
    return replace(found, result=result, predictions={}, opened=None)


def explains_better(
    found: Analysis, other: Analysis, opened: Explanation, lacking: float = 0.0
) -> bool:
    """Whether an explanation, of an analysis with opened priors, is far better than all of another.

    Its evidence counts beside the noise, scatter and discrepancy of the other one. So much of it
    may be `lacking`.
    """
    if other.error or not opened.names:
        return False
    if len(other.problem.readings) != len(found.problem.readings):
        return False
    rival = _rival(found)
    value = found.problem.discrepancy.evidence(opened.fit, opened.amplitude).value
    value += opened.penalty
    explains_more = opened.amplitude.max() < 0.5 * rival.amplitude.max()
    margin = NO_MARGIN if explains_more else OPENED_MARGIN
    return value < rival.objective - margin + lacking


def _rival(found: Analysis) -> Explanation:
    """The likeliest explanation that predicts rows kept back, the soil alone among them."""
    rivals = [c for c in (_predictive(found), found.result.soil_alone) if c is not None]
    return min(rivals, key=lambda c: c.objective)


def _predictive(found: Analysis) -> Explanation | None:
    """The likeliest explanation that predicts rows kept back no worse than the soil alone does.

    Within sampling error; an explanation that was not scored is none.
    """
    gains = predictive_gains(found.predictions)
    scored = (c for c in found.result.candidates if c.names in gains)
    return next((c for c in scored if not gains[c.names].is_worse), None)
