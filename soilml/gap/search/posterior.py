"""Posterior probabilities of effects, from the evidence of the sets that contain them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.gap.search.candidate_fits import CandidateFit

#: Posterior odds against the best explanation up to which another one is not rejected: 1 to 90.
REJECTION_THRESHOLD = 9.0
#: Probability of the soil alone below which the best explanation is supported.
MAX_CHANCE = 0.05
#: Factor on differences of the objective; below 1 because Laplace's approximation, linear
#: signatures and estimated covariances overstate the evidence. Calibrated on simulated sets.
TEMPERING = 1.0
#: Largest absolute log odds that are stated; beyond it a probability is 0 or 1 in any sense.
MOST_LOG_ODDS = 500.0

Names = tuple[str, ...]


@dataclass(frozen=True)
class Posterior:
    """Natural logarithms of the posterior probabilities of sets of effects, by names."""

    log_weights: dict[Names, float]

    def probability(self, effect: str) -> float:
        """Probability that an effect is present."""
        return float(np.exp(self._log_sum(lambda names: effect in names)))

    def weight(self, names: Names) -> float:
        """Probability that exactly this set of effects is present."""
        return float(np.exp(self.log_weights.get(names, -np.inf)))

    def effect_log_odds(self, effect: str) -> float:
        """Natural logarithm of the odds that an effect is present."""
        return self._log_odds(lambda names: effect in names)

    def set_log_odds(self, effects: Names) -> float:
        """Natural logarithm of the odds that all these effects are present."""
        return self._log_odds(lambda names: set(effects) <= set(names))

    def _log_odds(self, holds: Callable[[Names], bool]) -> float:
        odds = self._log_sum(holds) - self._log_sum(lambda names: not holds(names))
        return float(np.clip(odds, -MOST_LOG_ODDS, MOST_LOG_ODDS))

    def _log_sum(self, holds: Callable[[Names], bool]) -> float:
        values = [w for names, w in self.log_weights.items() if holds(names)]
        return float(np.logaddexp.reduce(values)) if values else -np.inf

    def effects(self) -> list[str]:
        """All effects with a probability, the likeliest first."""
        names = {name for names in self.log_weights for name in names}
        return sorted(names, key=lambda name: (-self.probability(name), name))


def explanations(candidates: Sequence[CandidateFit], found: Posterior) -> tuple[CandidateFit, ...]:
    """The smallest sets of effects that are not rejected, the best first.

    A set is left out if a part of it is not rejected either: the evidence for the rest of it is
    not decisive. The first of them is the soil alone where that is not rejected.
    """
    ordered = sorted(candidates, key=lambda c: c.objective)
    kept = [
        c
        for c in ordered
        if (
            c.objective <= ordered[0].objective + REJECTION_THRESHOLD / TEMPERING
            if c.names
            else found.weight(()) >= MAX_CHANCE
        )
    ]
    return tuple(c for c in kept if not any(set(o.names) < set(c.names) for o in kept))


def posterior(
    candidates: Sequence[CandidateFit], predicted: Mapping[str, float], none: CandidateFit
) -> Posterior:
    """Posterior probabilities of the candidates and of effects that were not fitted in full.

    Parameters
    ----------
    predicted : mapping
        Predicted decrease of the objective by each single effect.
    none : CandidateFit
        The soil alone.
    """
    objectives = {c.names: c.objective for c in candidates}
    for name, gain in predicted.items():
        objectives.setdefault((name,), none.objective - gain)
    logs = {names: -0.5 * TEMPERING * value for names, value in objectives.items()}
    total = float(np.logaddexp.reduce(list(logs.values())))
    return Posterior({names: value - total for names, value in logs.items()})
