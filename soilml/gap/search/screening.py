"""Screening: which single effects are fitted in full, by the gains that they should achieve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import Literal

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.problem import FitProblem, MarginalFit, within_bounds
from soilml.gap.search.explanation import Explanation
from soilml.numerics.subspaces import ROUNDING, project_out


def predicted_with_and_without(
    problem: FitProblem, soil_alone: Explanation, soil: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """The larger of the gains predicted from the fit under a discrepancy, and under noise alone.

    A discrepancy of large amplitude can hide an effect that explains nearly everything.
    """
    plain = MarginalFit(soil, problem.discrepancy.evidence(soil, soil_alone.amplitude))
    with_discrepancy, without = (
        predicted_gains(problem, Explanation((), fit), soil_alone.objective, signatures)
        for fit in (soil_alone.best, plain)
    )
    return {name: max(gain, without[name]) for name, gain in with_discrepancy.items()}


def predicted_gains(
    problem: FitProblem, candidate: Explanation, objective: float, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of an objective by one more effect, linearised at a candidate, by effect name.

    An effect whose size would have an impossible sign gains nothing.
    """
    if not signatures:
        return {}
    columns = np.column_stack([s.column for s in signatures])
    found = problem.discrepancy.evidence_with_each(candidate.fit, columns, candidate.amplitude)
    gains = {}
    for s, evidence in zip(signatures, found, strict=True):
        possible = s.sign == 0 or float(evidence.step[-1]) * s.sign > 0.0
        penalty = problem.penalties[s.name]
        value = evidence.value + candidate.penalty + penalty
        gains[s.name] = objective - value if possible else -penalty
    return gains


def free_law_gains(
    problem: FitProblem, amplitude: Floats, fit: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of a fit's sum of squares by each effect with free shapes, linearised.

    The shapes have no prior, so that these are upper bounds, by which effects are selected whose
    law is not the catalogue's.

    amplitude (channels,): That of the discrepancy.
    """
    whiten = problem.discrepancy.whiten(amplitude)
    fit = fit.whitened_by(whiten)
    slip, load = problem.readings.log_slip_and_load
    gains = {}
    for s in signatures:
        columns = s.column[:, None] * np.column_stack([np.ones_like(slip), slip, load])
        projected = project_out(whiten @ columns, within_bounds(fit))
        coefficient = np.linalg.lstsq(projected, fit.residual, rcond=ROUNDING)[0]
        possible = s.sign == 0 or coefficient[0] * s.sign > 0.0
        explained = float(np.sum((projected @ coefficient) ** 2))
        gains[s.name] = explained if possible else 0.0
    return gains


def noise_only_gains(
    problem: FitProblem, fit: Solution, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of a fit's sum of squares by each effect under noise alone, linearised."""
    whiten = problem.covariance.whiten
    fit = fit.whitened_by(whiten)
    gains = {}
    for s in signatures:
        column = project_out((whiten @ s.column)[:, None], within_bounds(fit))[:, 0]
        power = float(column @ column)
        moment = float(column @ fit.residual)
        possible = power > 0.0 and (s.sign == 0 or moment * s.sign > 0.0)
        gains[s.name] = moment**2 / power if possible else 0.0
    return gains


#: Effects are selected if their predicted gain is within this margin of the largest, and so many of
#: the largest in any case; the prediction is linear and can be wrong by that much.
GAIN_MARGIN, MIN_FITTED, MAX_FITTED = 12.0, 4, 9
FITTED_BY_OWN_LAW = 6  # So many effects more: those that would explain most by a law of their own
#: Beside a large discrepancy, so many effects more: those that explain most under noise alone, and
#: those that explain at least this share of what the first of them does. So many start under noise
#: alone too, and those that explain this share by a law of their own.
FITTED_HIDDEN, HIDDEN_SHARE = 6, 0.8
#: Amplitude, in usual ones, from which a discrepancy can hide an effect that explains it.
LARGE_DISCREPANCY = 2.5
#: Objective above that of the best candidate up to which shapes are estimated, sets extended, and
#: effects fitted again in a further search.
WITHIN_REACH = 15.0

#: Decrease of the objective, but for the penalty of an effect, below which it explains nothing.
LEAST_GAIN = 1.0

#: With `few`, so many of each ranking are fitted, and `MIN_FITTED` of the largest gains.
FIRST_OF_EACH = 2
#: Which single effects a look fits: all that are likely, the first of each ranking, or none.
Singles = Literal["all", "first", "none"]

#: Candidates of an earlier search, by effect names, whose optima are starts of this one.
Starts = Mapping[tuple[str, ...], Explanation]


def effects_to_fit(
    problem: FitProblem,
    soil_alone: Explanation,
    soil: Solution,
    signatures: Sequence[Signature],
    gains: Mapping[str, float],
    starts: Starts,
    without_gain: Set[str] = frozenset(),
    *,
    few: bool = False,
) -> dict[str, bool]:
    """The effects that are fitted in full, each alone, and whether they start under noise too.

    A prediction from the soil alone is linear, while the soil has adapted to what is missing and
    the law of the cause may be another one. Several predictions are therefore made, and the best of
    each are selected, together with those that were within reach of the best in an earlier search.
    One that explained nothing there, and should not gain now, is left out, but for the first.

    Beside a large discrepancy, those that no earlier search has fitted start under noise alone too,
    if they explain most there, or by a law of their own nearly as much as the first could: others
    rarely find a better optimum from there.

    soil_alone, soil: The soil alone, beside a discrepancy and under noise alone.
    gains: Predicted decrease of the objective by each effect.
    without_gain: Effects that explained nothing in an earlier search of the same soil.
    few: Select the first of each ranking only.
    """
    selected = _largest_gains(gains)
    amplitude = soil_alone.amplitude
    ranked = [
        _first(free_law_gains(problem, amplitude, f, signatures)) for f in (soil_alone.fit, soil)
    ]
    under_noise: list[str] = []
    if float(amplitude.max()) >= LARGE_DISCREPANCY:
        hidden = noise_only_gains(problem, soil, signatures)
        ranked.append(_first(hidden, max(FITTED_HIDDEN, len(_close(hidden)))))
        by_own_law = free_law_gains(problem, 0.0 * amplitude, soil, signatures)
        under_noise = ranked[-1][:FITTED_HIDDEN] + _close(by_own_law)
    lowest = min((c.objective for c in starts.values()), default=0.0)
    single = [c for names, c in starts.items() if len(names) == 1]
    ranked.append([c.names[0] for c in single if c.objective < lowest + WITHIN_REACH])
    if few:
        selected, ranked = selected[:MIN_FITTED], [own[:FIRST_OF_EACH] for own in ranked]
    names = dict.fromkeys([*selected, *(name for own in ranked for name in own)])
    left_out = {n for n in without_gain if gains.get(n, 0.0) + problem.penalties[n] < LEAST_GAIN}
    left_out -= set(selected[:1])
    return {
        name: name in under_noise and (name,) not in starts
        for name in names
        if name in gains and name not in left_out
    }


def explained_nothing(problem: FitProblem, fitted: Starts) -> set[str]:
    """The single effects that were fitted beside the soil and changed nothing."""
    alone = fitted[()].objective
    single = {names[0]: c for names, c in fitted.items() if len(names) == 1}
    gains = {name: alone - c.objective + problem.penalties[name] for name, c in single.items()}
    return {name for name, gain in gains.items() if gain < LEAST_GAIN}


FIRST_CANDIDATES = 4  # Candidates of an earlier search that a first look takes


def likeliest_sets(starts: Starts) -> list[tuple[str, ...]]:
    """The likeliest candidates of an earlier search."""
    ranked = sorted((c.objective, names) for names, c in starts.items() if names)
    return [names for _, names in ranked[:FIRST_CANDIDATES]]


def _largest_gains(gains: Mapping[str, float]) -> list[str]:
    """Effects in order of their predicted gain, those within the margin of the largest."""
    ordered = _first(gains, len(gains))
    close = [name for name in ordered if gains[name] > gains[ordered[0]] - GAIN_MARGIN]
    return ordered[: min(MAX_FITTED, max(MIN_FITTED, len(close)))]


def _close(gains: Mapping[str, float]) -> list[str]:
    """The effects that gain nearly as much as the first."""
    least = HIDDEN_SHARE * max(gains.values(), default=0.0)
    return [name for name, gain in gains.items() if gain > least]


def _first(gains: Mapping[str, float], number: int = FITTED_BY_OWN_LAW) -> list[str]:
    """The effects of the largest gains."""
    return sorted(gains, key=lambda name: -gains[name])[:number]
