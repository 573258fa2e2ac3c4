"""Decision: which status the posterior supports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.results import Suspect
from soilml.inference import constants
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Names, Posterior
from soilml.remarks import Remark
from soilml.report.numbers import format_probability, format_quantity

LISTED_SUSPECTS = 8  # Suspects that are listed
#: Why nothing is named where the evidence for the suspects is weak.
NOT_DECISIVE = Remark("not-decisive", "the evidence is not decisive beside the model's usual error")
#: Why an explanation that the evidence supports is not claimed, by codes.
_DOUBTS = {
    "implausible-size": "{} would have to be implausibly large: its law or the cause is another",
    "unchecked-fault": "{} is a fault that nothing has checked: a law that the catalogue lacks may "
    "look like it; check it, and state the check with --checked",
}


@dataclass(frozen=True)
class Decision:
    """The status, the sets of effects it claims, and the one whose figures are shown."""

    status: str
    claimed: tuple[Names, ...] = ()  # the sets that are stated as causes
    listed: tuple[Names, ...] = ()  # those that the data do not reject, the first suspect first
    shown: Explanation | None = None  # that of the first one; None where nothing is suspected
    reasons: tuple[Remark, ...] = ()  # why no cause is named, or no agreement stated


def ranked_sets(posterior: Posterior) -> list[Names]:
    """Sets of effects by the probability that they are present, alone or with others.

    The first one has all effects that are likelier than not.

    References: Barbieri and Berger, Optimal predictive model selection, Annals of Statistics 32,
    2004: of single models, that of these effects predicts best under usual conditions.
    """
    fitted = {node.hypothesis.effects for node in posterior.nodes}
    sets = [names for names in posterior.sets if names and names in fitted]
    if not sets:
        return []
    p = {names: posterior.probability(*names) for names in sets}
    best = max(sets, key=lambda names: (p[names] > 0.5) * len(names) + p[names])
    rest = sorted((names for names in sets if names != best), key=lambda names: -p[names])
    return [best, *rest]


def not_rejected(posterior: Posterior, ranked: Sequence[Names]) -> tuple[Names, ...]:
    """The smallest sets whose probability is within reach of the likeliest, the first one first."""
    if not ranked:
        return ()
    sets, first = posterior.sets, ranked[0]
    least = constants.REJECTED * max(sets[names] for names in ranked)
    kept = [first, *(n for n in ranked[1:] if sets[n] >= least and not set(first) < set(n))]
    return tuple(n for n in kept if not any(set(other) < set(n) for other in kept))


def decide(posterior: Posterior, obstacles: Sequence[Remark]) -> Decision:
    """The status of a report where a gap is likely; see `soilml.gap.statuses.STATUSES`.

    obstacles: Why these runs cannot identify a cause.
    """
    none, reasons = posterior.no_effect, tuple(obstacles)
    ranked = ranked_sets(posterior)
    chance = posterior.probability(*ranked[0]) if ranked else 0.0
    alone = next((n for n in posterior.nodes if not n.hypothesis.effects), None)
    # the soil alone is likeliest outside its priors, without a discrepancy
    other_soil = alone and alone.hypothesis.wide_priors and alone.share_without > 0.5
    if other_soil and none > max(constants.UNCERTAIN, chance):
        return Decision("undecided", reasons=(soil_outside_priors(posterior),))
    smooth = none - posterior.no_gap  # a gap that a smooth error explains
    if obstacles and (not ranked or none > 1.0 - constants.UNCERTAIN):
        return Decision("not-testable", reasons=reasons)
    if not ranked or (not obstacles and none > constants.UNCERTAIN and smooth > chance):
        return Decision("unknown")
    listed = not_rejected(posterior, ranked)
    best = listed[0]
    node = posterior.node_of(best)
    assert node is not None
    suspected = Decision("suspected", (), listed, node, reasons)
    if obstacles:
        return suspected
    if oversized(node.fit):
        return replace(suspected, reasons=(_reason("implausible-size", best),))
    if none > constants.UNCERTAIN:
        gap = 1.0 - posterior.no_gap
        why = gap_not_certain(gap) if gap < 1.0 - constants.UNCERTAIN else NOT_DECISIVE
        return replace(suspected, reasons=(why,))
    if chance >= constants.NAMED_PROBABILITY:
        # an offset of one channel imitates what no catalogue has, such as a crust on the soil: a
        # check of the sensor shows a fault, rows alone do not
        problem = posterior.problem
        faults = (n for n in best if problem.effects[n].about.kind in ("sensor", "rig"))
        if unchecked := tuple(n for n in faults if n not in problem.calibration):
            return replace(suspected, reasons=(_reason("unchecked-fault", unchecked),))
        status = "named"
        if node.share_without < constants.LIKELIER:
            status = "partly-named"
        elif node.hypothesis.free_law:
            status = "form-open"
        return Decision(status, (best,), listed[:1], node)
    together = sum(posterior.sets[names] for names in listed)
    if none <= constants.CHANCE and len(listed) > 1 and together >= constants.LIKELIER:
        return Decision("class", listed, listed, node)
    return replace(suspected, reasons=(NOT_DECISIVE,))


def gap_not_certain(probability: float) -> Remark:
    """Why nothing is named where there may be no gap."""
    text = f"that there is a gap is not certain (probability {format_probability(probability)})"
    return Remark("gap-not-certain", text)


def pressed_priors(fit: Solution) -> dict[str, str]:
    """The soil parameters that a fit has at an end of their prior, by path, in words."""
    found = {}
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if not c.effect and min(x - c.lower, c.upper - x) < constants.PRESSED:
            end, bound = ("lower", c.prior.lower) if x < 0.5 else ("upper", c.prior.upper)
            value = format_quantity(bound, c.unit)
            found[c.path] = f"{c.name.replace('_', ' ')} at {value}, the {end} end of its prior"
    return found


def opened_priors(posterior: Posterior) -> tuple[Remark, ...]:
    """That the likeliest explanation lies outside the priors of the soil, which forbids a name."""
    best = posterior.best.hypothesis
    if not best.wide_priors:
        return ()
    if not best.effects:
        return (soil_outside_priors(posterior),)
    opened = "prior-opened", "the priors of the soil were opened"
    return (soil_outside_priors(posterior, *opened),)


def soil_outside_priors(
    posterior: Posterior,
    code: str = "soil-outside-priors",
    text: str = "a soil outside its priors explains the rows",
) -> Remark:
    """That the rows are explained where the soil's priors are opened, and what is within them."""
    pressed = pressed_priors(posterior.soil.fit)
    why = f"within them, the fit has {'; '.join(pressed.values()) or 'a large remainder'}"
    return Remark(code, f"{text}: {why}", tuple(pressed))


def _reason(code: str, names: Names) -> Remark:
    return Remark(code, _DOUBTS[code].format(" + ".join(names)), names)


def oversized(fit: Solution) -> bool:
    """Whether an effect of soil or gear is far larger than usual ones."""
    return any(
        c.effect and not c.is_shape and np.isinf(c.std) and abs(x) > constants.LARGEST_SIZE
        for c, x in zip(fit.coordinates, fit.x, strict=True)
    )


def suspects(posterior: Posterior, decision: Decision) -> list[Suspect]:
    """Explanations with their odds against all others, the first one that is shown first."""
    ranked = ranked_sets(posterior)
    first = decision.listed[:1] or tuple(ranked[:1])
    rest = [n for n in ranked if posterior.within(n) > constants.LEAST_DRAWN]
    rest = [n for n in rest if not any(set(n) <= set(o) or set(o) < set(n) for o in first)]
    found = []
    for names in [*first, *rest[: LISTED_SUSPECTS - 1]]:
        odds, chance = posterior.log_odds(*names), posterior.probability(*names)
        found.append(Suspect(names, odds, chance))
    return found
