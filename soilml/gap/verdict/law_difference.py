"""Whether the estimated law of an effect predicts anything else than the catalogue's law."""

from __future__ import annotations

import numpy as np

from soilml.gap.search.candidate_fits import CandidateFit
from soilml.gap.search.problem import FitProblem

#: Difference of the predictions of two laws, as a fraction of a channel's range, below which the
#: law does not matter: that of a usual model error.
NEGLIGIBLE_FRACTION = 0.02


def law_matters(problem: FitProblem, candidate: CandidateFit) -> bool:
    """Whether the two laws differ inside the measured range by more than matters.

    They differ if, in some channel, the root mean square difference of their predictions exceeds
    both the standard error of a mean over the readings of that channel and the range of the channel
    times `NEGLIGIBLE_FRACTION`.
    """
    readings = problem.readings
    difference = candidate.free_law.fit.prediction - candidate.catalogue_law.fit.prediction
    for i in range(len(readings.channels)):
        in_channel = readings.channel == i
        values = readings.reading[in_channel]
        if not values.size:
            continue
        rms = float(np.sqrt(np.mean(difference[in_channel] ** 2)))
        mean_error = float(np.sqrt(np.mean(problem.covariance.std[in_channel] ** 2) / values.size))
        span = max(float(values.max()), 0.0) - min(float(values.min()), 0.0)
        if rms > max(mean_error, NEGLIGIBLE_FRACTION * span):
            return True
    return False
