"""Fits beside a smooth discrepancy, each with the amplitude that its own evidence supports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.fitting.least_squares import Solution
from soilml.gap.search.problem import FitProblem, StartedFit, fit_many
from soilml.gap.statistics.evidence import Evidence

Floats = NDArray[np.float64]

#: Fits at most under successive estimates of the discrepancy; the estimate of the amplitudes hardly
#: changes after the second.
MAX_ROUNDS = 3
#: Change of an amplitude, in usual ones and relative to itself, below which a fit is final: the
#: weights of the readings then hardly change.
AMPLITUDE_TOLERANCE, AMPLITUDE_RATIO = 0.3, 0.7
#: Evidence, in -2 ln p above the best, beyond which a fit is not repeated: repetition lowers it by
#: 35 at most, by less than 10 for most fits.
HOPELESS = 40.0


@dataclass(frozen=True)
class MarginalFit:
    """A fit under the discrepancy that its own evidence supports.

    `first` is the fit under the amplitudes of the discrepancy that were started with.
    """

    fit: Solution
    evidence: Evidence
    first: Solution | None = None


def fit_marginal(
    problem: FitProblem,
    requests: Sequence[tuple[StartedFit, Floats]],
    lowest: float = float("inf"),
) -> list[MarginalFit | None]:
    """Fits and their evidence; None where the model refuses the fit.

    Each request has the amplitudes of the discrepancy by channel to start with. Fit and amplitudes
    are repeated in turn until the amplitudes hardly change, for fits whose evidence is not far
    above the lowest of them, and `lowest`, that of an earlier fit.
    """
    found: list[MarginalFit | None] = [None] * len(requests)
    waiting = dict(enumerate(requests))
    for _ in range(MAX_ROUNDS):
        started = [
            replace(fit, whiten=problem.discrepancy.whiten(amplitude))
            for fit, amplitude in waiting.values()
        ]
        fits = fit_many(problem, started)
        again = {}
        for (i, (request, amplitude)), fit in zip(waiting.items(), fits, strict=True):
            if isinstance(fit, InputError):
                continue
            evidence = problem.discrepancy.evidence(fit, amplitude)
            if not np.isfinite(evidence.value):  # some row has no equilibrium at the optimum
                continue
            earlier = found[i]
            found[i] = MarginalFit(fit, evidence, earlier.first if earlier else fit)
            lowest = min(lowest, evidence.value)
            if _changed(amplitude, evidence.amplitude):
                again[i] = (replace(request, start=fit.start_values()), evidence.amplitude)
        waiting = {}
        for i, repeated in again.items():
            marginal = found[i]
            if marginal is not None and marginal.evidence.value < lowest + HOPELESS:
                waiting[i] = repeated
        if not waiting:
            break
    return found


def _changed(before: Floats, after: Floats) -> bool:
    """Whether the amplitudes of a discrepancy changed so much that a fit must be repeated."""
    larger, smaller = np.maximum(before, after), np.minimum(before, after)
    changed = (larger - smaller > AMPLITUDE_TOLERANCE) & (smaller < AMPLITUDE_RATIO * larger)
    return bool(changed.any())
