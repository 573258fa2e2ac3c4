"""Selection: which single effects are fitted in full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from soilml.fitting.least_squares import Solution
from soilml.gap.search.candidate_fits import CandidateFit
from soilml.gap.search.predicted_gains import free_law_gains, noise_only_gains
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.signatures import Signature

#: Effects are selected if their predicted gain is within this margin of the largest, and so many of
#: the largest in any case; the prediction is linear and can be wrong by that much.
GAIN_MARGIN, MIN_FITTED, MAX_FITTED = 12.0, 4, 9
#: So many effects more: those that would explain most by a law of their own.
FITTED_BY_OWN_LAW = 6
#: Beside a large discrepancy, so many effects more: those that explain most under noise alone.
FITTED_HIDDEN = 6
#: Amplitude, in usual ones, from which a discrepancy can hide an effect that explains it.
LARGE_DISCREPANCY = 2.5
#: Objective above that of the best candidate up to which shapes are estimated, sets extended, and
#: effects fitted again in a further search.
WITHIN_REACH = 15.0

#: Candidates of an earlier search, by effect names, whose optima are starts of this one.
Starts = Mapping[tuple[str, ...], CandidateFit]


def effects_to_fit(
    problem: FitProblem,
    none: CandidateFit,
    soil: Solution,
    signatures: Sequence[Signature],
    gains: Mapping[str, float],
    starts: Starts,
) -> list[str]:
    """Names of the effects that are fitted in full, each alone.

    A prediction from the soil alone is linear, while the soil has adapted to what is missing and
    the law of the cause may be another one. Several predictions are therefore made, and the best of
    each are selected, together with those that were within reach of the best in an earlier search.

    Parameters
    ----------
    none, soil : CandidateFit, Solution
        The soil alone, beside a discrepancy and under noise alone.
    gains : mapping
        Predicted decrease of the objective by each effect.
    """
    selected = _largest_gains(gains)
    ranked = [_first(free_law_gains(problem, none, f, signatures)) for f in (none.fit, soil)]
    if float(none.amplitude.max()) >= LARGE_DISCREPANCY:
        ranked.append(_first(noise_only_gains(problem, soil, signatures), FITTED_HIDDEN))
    lowest = min((c.objective for c in starts.values()), default=0.0)
    single = [c for names, c in starts.items() if len(names) == 1]
    ranked.append([c.names[0] for c in single if c.objective < lowest + WITHIN_REACH])
    names = dict.fromkeys([*selected, *(name for own in ranked for name in own)])
    return [name for name in names if name in gains]


def _largest_gains(gains: Mapping[str, float]) -> list[str]:
    """Effects in order of their predicted gain, those within the margin of the largest."""
    ordered = _first(gains, len(gains))
    close = [name for name in ordered if gains[name] > gains[ordered[0]] - GAIN_MARGIN]
    return ordered[: min(MAX_FITTED, max(MIN_FITTED, len(close)))]


def _first(gains: Mapping[str, float], number: int = FITTED_BY_OWN_LAW) -> list[str]:
    """The effects of the largest gains."""
    return sorted(gains, key=lambda name: -gains[name])[:number]
