"""Posterior probabilities of effects, from the evidence of the sets that contain them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from soilml.gap.evidence.marginal_likelihood import TEMPERING
from soilml.gap.evidence.prior_odds import EXPECTED_CAUSES
from soilml.gap.search.explanation import Explanation
from soilml.report.numbers import LEAST_STATED

#: Decrease of the objective by the best explanation from which another one is rejected: tempered
#: odds of 1 to 33.
REJECTION_THRESHOLD = 14.0
#: Probability of the soil alone, beside its discrepancy, below which a single explanation is named
#: and several are stated as a class; a name needs more evidence than a list.
MAX_CHANCE_NAME, MAX_CHANCE_CLASS = 0.01, 0.2
#: Factor on differences of the evidence in stated probabilities. What decides whether a cause is
#: stated takes the smaller `TEMPERING`. With it, the stated probabilities of 596 tuning sets
#: (`datagen.blind_sets`, seeds 80 and 81) met the frequencies within 0.03; with 0.5 they were too
#: small by up to 0.07, and with 0.7 too large by as much.
STATED_TEMPERING = 0.6
#: Probability that an effect of the catalogue is the right description of a cause that it explains.
#: Of the effects with a probability above 0.9, 160 of 162 were, in these tuning sets with causes
#: outside the catalogue among them (0.956 to 0.998 with 95 %); it is chosen on the careful side.
IN_CATALOGUE = 0.97
#: Natural logarithm of the factor by which stated probabilities raise the prior odds of all sets of
#: effects: the search tries few sets of several effects, and the prior probability of those that it
#: does not try belongs to the others. Else the soil alone would be expected in 50 % of cases, and
#: not in the 37 % of `EXPECTED_CAUSES`.
LOG_UNTRIED = float(np.log(np.expm1(EXPECTED_CAUSES) / EXPECTED_CAUSES))
#: The same, relative to that, of an effect that explains the data by another law than the
#: catalogue's: 1 of 4 on tuning sets, most of them with a cause outside the catalogue.
OTHER_LAW = 0.3
#: Rise of log odds, by half, from which rows speak for an effect. One that they leave as likely as
#: it was beforehand, such as a sensor's gain that nothing tests, is no further suspect.
RAISED = 0.4
#: Largest absolute log odds that are stated; beyond it a probability is 0 or 1 in any sense.
MOST_LOG_ODDS = 500.0

Names = tuple[str, ...]


@dataclass(frozen=True)
class Posterior:
    """Natural logarithms of the posterior probabilities of sets of effects, by names.

    Sets in `refused` explain the data only by a law or a size that the catalogue does not have:
    another cause may be at work, but for those of their effects, given with them, that explain
    most of the data without the others. A set with another law counts with `OTHER_LAW`.

    Of these, the sets in `unlisted` are no suspects: they predict rows that were kept back worse
    than the soil alone does, beyond sampling error, or need an implausible fault of a sensor. Those
    in `oversized` need an implausible size: none of them comes first where another set is listed,
    which has a probability of at least `LEAST_STATED` where theirs is.
    Those in `unproven` predict them no better, within sampling error: they can be suspected, not
    named.

    `before` is the mean probability of an effect before any row is seen. It is what is left to each
    where the cause is another one than the catalogue has: the same for all, which keeps the order.
    """

    log_weights: dict[Names, float]
    refused: Mapping[Names, frozenset[str]] = field(default_factory=dict)
    unlisted: frozenset[Names] = frozenset()
    unproven: frozenset[Names] = frozenset()
    oversized: frozenset[Names] = frozenset()
    before: float = 0.0

    def probability(self, *effects: str) -> float:
        """Probability that these effects are present, causes outside the catalogue included."""
        within = float(np.exp(self._log_shares(effects)[0]))
        return IN_CATALOGUE * within + (1.0 - IN_CATALOGUE) * self.before

    def weight(self, names: Names) -> float:
        """Probability that exactly this set of effects is present."""
        return float(np.exp(self.log_weights.get(names, -np.inf)))

    def log_odds(self, *effects: str) -> float:
        """Natural logarithm of the odds that these effects are present, within the catalogue."""
        present, absent = self._log_shares(effects)
        return float(np.clip(present - absent, -MOST_LOG_ODDS, MOST_LOG_ODDS))

    def favours(self, names: Names, penalty: float) -> bool:
        """Whether the data raise the odds of a set of effects: alone, or with others beside it.

        penalty: -2 ln of its prior odds. A set that leaves the evidence as it is raises nothing.
        """
        logs, least = self.log_weights, RAISED + LOG_UNTRIED - 0.5 * penalty
        alone = logs.get(names, -np.inf) - logs.get((), -np.inf)
        return max(alone, self.log_odds(*names)) > least

    def is_stated(self, names: Names) -> bool:
        """Whether the probability of a set of effects is more than a bound."""
        return self.probability(*names) >= LEAST_STATED

    def ranked(self) -> list[tuple[Names, float]]:
        """Sets of effects with the natural logarithm of their odds, the likeliest first.

        A set that contains a listed one is not listed, unless it is of usual size and the others of
        its effects are more likely than not where that one is present: then it is listed in its
        place. Of a set with effects that are each more likely than not, these are listed.

        References: Barbieri and Berger, Optimal predictive model selection, Annals of Statistics
        32, 2004: of single models, that of these effects predicts best under usual conditions.
        """
        listed = {self._core(own) for names in self.log_weights if (own := self._suspects(names))}
        odds = {names: self.log_odds(*names) for names in listed}
        for names in sorted(listed, key=lambda n: (-len(n), n)):
            parts = [n for n in odds if set(n) < set(names)]
            usual = names not in self.oversized
            if usual and parts and min(self._given(names, part) for part in parts) > 0.5:
                odds = {n: value for n, value in odds.items() if n not in parts}
            elif parts:
                del odds[names]
        return sorted(odds.items(), key=lambda item: (-item[1], -self.weight(item[0]), item[0]))

    def from_first(
        self, ranked: Sequence[tuple[Names, float]], fitted: Mapping[Names, float]
    ) -> list[tuple[Names, float]]:
        """Ranked sets from the first suspect: the likeliest of usual size that was fitted in full.

        Likelier ones of an implausible size follow it, if the data raise its odds, and if it has a
        probability that is stated where theirs is. Without such a one, the likeliest comes first.

        fitted: -2 ln of the prior odds of each set that was fitted.
        """
        known = [i for i, (names, _) in enumerate(ranked) if names in fitted]
        raised = [i for i in known if self.favours(ranked[i][0], fitted[ranked[i][0]])]
        usual = [i for i in raised if ranked[i][0] not in self.oversized]
        if known and ranked[known[0]][0] not in self.oversized:
            usual = known
        elif known and self.is_stated(ranked[known[0]][0]):
            usual = [i for i in usual if self.is_stated(ranked[i][0])]
        first = (usual or known or [0])[0]
        before = [own for own in ranked[:first] if own[0] in self.oversized]
        return [*ranked[first : first + 1], *before, *ranked[first + 1 :]]

    def effects(self) -> list[str]:
        """All effects with a probability, the likeliest first."""
        names = {name for names in self.log_weights for name in names}
        return sorted(names, key=lambda name: (-self.log_odds(name), name))

    def _suspects(self, names: Names) -> Names:
        """The effects of a set that can be suspected."""
        if names in self.unlisted:
            return tuple(sorted(self.refused.get(names, ())))
        return names

    def _core(self, names: Names) -> Names:
        """The effects of a set that are more likely than not, if they are a set themselves."""
        core = tuple(name for name in names if self.log_odds(name) > 0.0)
        return core if core and core in self.log_weights else names

    def _given(self, names: Names, part: Names) -> float:
        """Probability that all effects of a set are present where those of a part of it are."""
        return float(np.exp(self._log_shares(names)[0] - self._log_shares(part)[0]))

    def _share(self, names: Names, effects: Collection[str]) -> float:
        """Probability, within the catalogue, that these effects are causes where a set explains."""
        if not set(effects) <= set(names):
            return 0.0
        if names not in self.refused or set(effects) <= self.refused[names]:
            return 1.0
        return 0.0 if names in self.unlisted else OTHER_LAW

    def _log_shares(self, effects: Collection[str]) -> tuple[float, float]:
        """Logarithms of the probabilities, within the catalogue, that effects are there or not."""
        weights = np.fromiter(self.log_weights.values(), dtype=np.float64)
        share = np.asarray([self._share(names, effects) for names in self.log_weights])
        with np.errstate(divide="ignore"):
            both = [weights + np.log(part) for part in (share, 1.0 - share)]
        present, absent = (float(np.logaddexp.reduce(logs, initial=-np.inf)) for logs in both)
        return present, absent


def explanations(candidates: Sequence[Explanation], found: Posterior) -> tuple[Explanation, ...]:
    """The smallest sets of effects that are not rejected, the best first.

    A set is left out if a part of it is not rejected either: the evidence for the rest of it is
    not decisive. The first of them is the soil alone where that is not rejected.

    found: The probabilities by `for_decisions`.
    """
    kept = not_rejected(candidates)
    limit = MAX_CHANCE_NAME if len(kept) == 1 else MAX_CHANCE_CLASS
    alone = [c for c in candidates if not c.names and found.weight(()) >= limit]
    return _smallest([*kept, *alone])


def not_rejected(candidates: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """The smallest sets of effects that are not rejected against the best one, the best first."""
    lowest = min((c.objective for c in candidates if c.names), default=np.inf)
    limit = lowest + REJECTION_THRESHOLD
    return _smallest([c for c in candidates if c.names and c.objective <= limit])


def _smallest(candidates: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """The sets of which no part is among the candidates, in order of their objective."""
    kept = [c for c in candidates if not any(set(o.names) < set(c.names) for o in candidates)]
    return tuple(sorted(kept, key=lambda c: c.objective))


def posterior(
    candidates: Sequence[Explanation],
    predicted: Mapping[str, float],
    soil_alone: Explanation,
    penalties: Mapping[str, float],
) -> Posterior:
    r"""Posterior probabilities of the candidates and of effects that were not fitted in full.

    .. math:: \ln p = -\tfrac{1}{2} (T e + p_0) + u + \text{constant}

    with the evidence e, -2 ln of the marginal likelihood, tempered by T = `STATED_TEMPERING`,
    -2 ln of the prior odds p_0, which is not, and u = `LOG_UNTRIED` of all sets but the empty one.

    predicted: Predicted decrease of the objective by each single effect.
    soil_alone: The soil alone, beside a smooth discrepancy.
    penalties: -2 ln of the prior odds of each effect.
    """
    objectives = _objectives(candidates, predicted, soil_alone)
    prior = {names: sum(penalties[n] for n in names) for names in objectives}
    logs = {
        n: -0.5 * (STATED_TEMPERING * (value - prior[n]) + prior[n]) + (LOG_UNTRIED if n else 0.0)
        for n, value in objectives.items()
    }
    odds = np.exp([-0.5 * penalty for penalty in penalties.values()])
    return replace(
        _normalised(logs), before=float(np.mean(odds / (1.0 + odds))) if penalties else 0.0
    )


def for_decisions(
    candidates: Sequence[Explanation], predicted: Mapping[str, float], soil_alone: Explanation
) -> Posterior:
    """The probabilities that decide whether a cause is stated: with tempered prior odds.

    They favour effects, since to miss a cause costs more than to list one too many.
    """
    objectives = _objectives(candidates, predicted, soil_alone)
    return _normalised({n: -0.5 * TEMPERING * value for n, value in objectives.items()})


def _objectives(
    candidates: Sequence[Explanation], predicted: Mapping[str, float], soil_alone: Explanation
) -> dict[Names, float]:
    """Objectives of all candidates, and those predicted of other single effects."""
    objectives = {c.names: c.objective for c in candidates}
    for name, gain in predicted.items():
        if np.isfinite(gain):  # else its signature is that of rows without an equilibrium
            objectives.setdefault((name,), soil_alone.objective - gain)
    return objectives


def _normalised(logs: Mapping[Names, float]) -> Posterior:
    total = float(np.logaddexp.reduce(list(logs.values())))
    return Posterior({names: value - total for names, value in logs.items()})
