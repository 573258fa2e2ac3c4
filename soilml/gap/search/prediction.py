"""How explanations predict rows that were kept back, beside the soil alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.gap.evidence.held_out import (
    REGION,
    SLIPS,
    HeldOutPrediction,
    held_out_folds,
    predict_parts,
)
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.search.posterior import Names
from soilml.gap.search.stepwise import SearchResult

#: Explanations that are scored together, the likeliest first, and how often the next ones are
#: scored where none of them predicts better than the soil alone.
SCORED, ROUNDS = 4, 2
#: Explanations that are scored first: those that may be stated. Larger sets that contain them can
#: be likelier.
FIRST_ACCEPTED = 2
#: Least standard error of a gain, in nats, by which it is judged: a difference of log densities
#: below 1 is no evidence. Kass and Raftery, Journal of the American Statistical Association 90,
#: 1995, section 3.2, call twice such a difference below 2 "not worth more than a bare mention".
LEAST_ERROR = 1.0


@dataclass(frozen=True)
class PredictiveGain:
    """Log density of rows kept back, above that of the soil alone, and its standard error.

    The error is that of a sum over folds that differ by chance; a part that is one fold adds none.
    It is None where every part is one fold, since nothing then tells it.
    """

    value: float
    std_error: float | None = None

    @property
    def is_better(self) -> bool:
        """Whether the rows are predicted better than by the soil alone."""
        return self.value > 0.0

    @property
    def is_worse(self) -> bool:
        """Whether they are predicted worse, beyond what folds differ by chance."""
        return self.value <= -self._judged_error

    @property
    def is_clearly_better(self) -> bool:
        """Whether they are predicted better, beyond what folds differ by chance."""
        return self.value >= self._judged_error

    @property
    def _judged_error(self) -> float:
        return max(self.std_error or 0.0, LEAST_ERROR)


#: Predictions of each part that was kept back, by the effects of the explanation.
Predictions = Mapping[Names, Mapping[str, HeldOutPrediction]]


def predict_with(problem: FitProblem, result: SearchResult, seed: int) -> Predictions:
    """Predictions by the soil alone and by the likeliest explanations, beside their remainders.

    Whole runs, the heaviest loads, or levels of slip are kept back; soil and effects are fitted
    without them. Empty where nothing can be kept back, or no effect was searched for.
    """
    parts = held_out_folds(problem.readings, seed)
    if result.soil_alone is None or not parts:
        return {}
    listed = [*result.accepted[:FIRST_ACCEPTED], *result.candidates]
    waiting = list({c.names: c for c in listed if c.names}.values())
    found: dict[Names, Mapping[str, HeldOutPrediction]] = {}
    asked = [result.soil_alone]
    for _ in range(ROUNDS):
        asked, waiting = [*asked, *waiting[:SCORED]], waiting[SCORED:]
        models = [(c.fit, c.amplitude) for c in asked]
        predicted = predict_parts(problem, models, parts)
        found |= {c.names: own for c, own in zip(asked, predicted, strict=True)}
        asked = []
        if not waiting or any(gain.is_better for gain in predictive_gains(found).values()):
            break
    return found


def predictive_gains(predictions: Predictions) -> dict[Names, PredictiveGain]:
    """Log density of the rows kept back, above that of the soil alone, mean over the parts.

    By the effects of each explanation that was scored. Where each slip is predicted, its ends are
    among them, and the region of high slips does not count again.

    References: Vehtari and Ojanen, Statistics Surveys 6, 2012, section 2 (the log score);
    Vehtari, Gelman and Gabry, Statistics and Computing 27, 2017, eq. 24 (its sampling error).
    """
    alone = predictions.get((), {})
    counted = sorted(part for part in alone if part != REGION or SLIPS not in alone)
    gains = {}
    for names, own in predictions.items():
        if not names:
            continue
        by_fold = [
            np.subtract(own[part].log_densities, alone[part].log_densities) for part in counted
        ]
        variances = [len(d) * float(np.var(d, ddof=1)) for d in by_fold if len(d) > 1]
        value = float(np.mean([d.sum() for d in by_fold]))
        error = float(np.sqrt(sum(variances))) / len(by_fold) if variances else None
        gains[names] = PredictiveGain(value, error)
    return gains
