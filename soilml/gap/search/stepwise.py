"""Stepwise search for missing effects, by their evidence beside a smooth discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.problem import (
    FitProblem,
    MarginalFit,
    StartedFit,
    fit_marginal,
)
from soilml.gap.search.explanation import (
    CandidateRequest,
    Explanation,
    fit_candidates,
    fit_shapes,
    predicted_shape_gain,
)
from soilml.gap.search.posterior import Posterior, explanations, for_decisions, posterior
from soilml.gap.search.residual_test import ResidualTest, residual_test
from soilml.gap.search.screening import (
    WITHIN_REACH,
    Singles,
    Starts,
    effects_to_fit,
    explained_nothing,
    predicted_gains,
    predicted_with_and_without,
)
from soilml.remarks import Remark

GAP_LEVEL = 0.03  # Family-wise significance level of the test for a gap
#: Significance level of the test for a remainder that the best explanation does not account for.
LACK_OF_FIT_LEVEL = 0.001
#: Predicted gain, net of the penalty for one more effect, from which an extension is fitted.
MIN_NET_GAIN = -2.0
#: Largest number of effects in a candidate; sets that are extended by one effect in each step, and
#: effects that each of them is extended by.
MAX_EFFECTS, EXTENDED_SETS, EXTENSIONS = 3, 3, 3
STEPS = 1 + MAX_EFFECTS  # Steps of a search: the test for a gap, and the sets of each size
#: Upper bound of the improvement by free shapes, in linearised gains; the full fit can exceed the
#: linearised gain because the size changes with the shape.
SHAPE_GAIN_FACTOR = 3.0
#: Decrease of the sum of squares under noise alone from which the free law of an effect is tried,
#: and multiple of the least that an effect leaves, up to which it is.
NOTABLE_GAIN, NOTABLE_RATIO = 20.0, 2.0
#: Distance from the middle of the priors at which a second fit starts, relative to the optimum of
#: the soil alone.
INWARD = 0.8
#: Probability of residuals by noise alone above which nothing is left for a further effect.
COMPLETE_LEVEL = 0.2
#: Decrease of the objective by an extension below which no larger set is tried.
MIN_IMPROVEMENT = 1.0
#: Explanations whose soils the soil alone is fitted from again, and the decrease of its objective
#: above which that is another optimum.
SOILS_AGAIN, SAME_OPTIMUM = 2, 0.1
#: Change of each soil parameter, as a fraction of its prior, below which two soils are the same.
SAME_SOIL = 0.05


@dataclass(frozen=True)
class SearchResult:
    """Result of the search; `final_test` is that of the best explanation, or of the soil alone."""

    soil: Solution  # the soil alone, under noise and scatter
    soil_test: ResidualTest
    #: explanations that are not rejected against the best one, in order of their objective
    accepted: tuple[Explanation, ...]
    #: all candidates that were fitted, the empty set among them
    candidates: tuple[Explanation, ...]
    final_test: ResidualTest
    predicted_gain: dict[str, float]
    posterior: Posterior
    #: why these runs cannot test an effect, by its name
    untestable: Mapping[str, Remark] = field(default_factory=dict)
    #: single effects that explained nothing where they were last fitted
    without_gain: Set[str] = frozenset()

    @property
    def has_gap(self) -> bool:
        """Whether the fit of the soil alone is rejected."""
        return self.soil_test.p_value < GAP_LEVEL

    @property
    def adequate(self) -> bool:
        """Whether the residuals of the best explanation are consistent with noise."""
        return self.final_test.p_value >= LACK_OF_FIT_LEVEL

    @property
    def best(self) -> Solution:
        """The fit of the best explanation; of the soil alone without a search."""
        return self.accepted[0].fit if self.accepted else self.soil

    @property
    def soil_alone(self) -> Explanation | None:
        """The soil alone beside a smooth discrepancy; None where no gap was searched."""
        return next((c for c in self.candidates if not c.names), None)

    @property
    def likeliest(self) -> Explanation | None:
        """The most probable candidate with effects, by its objective; None without a search."""
        return next((c for c in self.candidates if c.names), None)

    @property
    def likeliest_suspect(self) -> Explanation | None:
        """The likeliest candidate that can be the first suspect; see `Posterior`."""
        refused = self.posterior.unlisted | self.posterior.oversized
        return next((c for c in self.candidates if c.names and c.names not in refused), None)


def without_search(
    soil: Solution, test: ResidualTest, untestable: Mapping[str, Remark] | None = None
) -> SearchResult:
    """The result where no effect was searched for: there are no candidates."""
    return SearchResult(
        soil=soil,
        soil_test=test,
        accepted=(),
        candidates=(),
        final_test=test,
        predicted_gain={},
        posterior=Posterior({}),
        untestable=untestable or {},
    )


def search(
    problem: FitProblem,
    soil: Solution,
    seed: int,
    starts: Starts | None = None,
    progress: Callable[[float], None] = lambda _: None,
    begun: SearchResult | None = None,
) -> SearchResult:
    """Search for the effects that explain what the soil alone does not.

    Candidates are fitted jointly with the soil, by their catalogue law; where it could bring them
    close to the best, with free shapes too. Sets within reach of the best are extended by one
    effect while that increases the evidence.

    soil: The soil alone, fitted under noise and scatter without discrepancy.
    starts: Candidates of an earlier search.
    progress: Called with the share of the search that is done, from 0 to 1.
    begun: The first look of this search, where it is known.
    """
    starts = starts or {}
    first = begun or first_look(problem, soil, seed, starts)
    if first.has_gap:
        progress(1 / STEPS)
    fitted = {c.names: c for c in first.candidates}
    level = [c for names, c in fitted.items() if len(names) == 1]
    for effects in range(1, MAX_EFFECTS if level else 1):
        progress((1 + effects) / STEPS)
        best = min(fitted.values(), key=lambda c: c.objective)
        if is_complete(problem, best, first, seed):
            break
        extensions = _extensions(problem, level, best.objective)
        known = [fitted[names] for names in extensions if names in fitted]
        new = {names: base for names, base in extensions.items() if names not in fitted}
        level = [*known, *_fit_level(problem, soil, fitted[()], new, starts)]
        fitted |= {c.names: c for c in level}
        if not level or min(c.objective for c in level) > best.objective - MIN_IMPROVEMENT:
            break
    if len(fitted) == len(first.candidates):
        return first
    return _concluded(problem, first, fitted, seed)


def first_look(
    problem: FitProblem,
    soil: Solution,
    seed: int,
    starts: Starts,
    sets: Sequence[tuple[str, ...]] = (),
    *,
    singles: Singles = "all",
    without_gain: Set[str] = frozenset(),
) -> SearchResult:
    """The test for a gap, and where there is one the explanations by single effects.

    sets: Other sets that are fitted too.
    singles: Which single effects are fitted. With neither these nor sets, it is the test alone;
        what the best explanation leaves is tested only with all.
    without_gain: Those that explained nothing in an earlier search of this soil; they are left out.
    """
    signatures, untestable = problem.signatures_and_untestable(soil)
    soil_test = residual_test(problem, soil, signatures, seed, within_priors=True)
    found = without_search(soil, soil_test, untestable)
    if (singles == "none" and not sets) or soil_test.p_value >= GAP_LEVEL:
        return found
    alone = _fit_soil_alone(problem, soil, starts)
    gains = predicted_with_and_without(problem, alone, soil, signatures)
    found = replace(
        found, candidates=(alone,), predicted_gain=gains, without_gain=frozenset(without_gain)
    )
    return look_further(problem, found, seed, starts, sets, singles=singles)


def look_further(
    problem: FitProblem,
    look: SearchResult,
    seed: int,
    starts: Starts,
    sets: Sequence[tuple[str, ...]] = (),
    *,
    singles: Singles = "all",
) -> SearchResult:
    """The look, in which the soil alone is fitted, with what it lacks; see `first_look`."""
    fitted, soil = {c.names: c for c in look.candidates}, look.soil
    signatures, soil_alone = look.soil_test.signatures, fitted[()]
    gains, likely = look.predicted_gain, dict[str, bool]()
    if singles != "none":
        few, without_gain = singles == "first", look.without_gain
        likely = effects_to_fit(
            problem, soil_alone, soil, signatures, gains, starts, without_gain, few=few
        )
    asked = dict.fromkeys([*sets, *((name,) for name in likely)], soil_alone)
    selected = {names: base for names, base in asked.items() if names not in fitted}
    under_noise = {name for name, also in likely.items() if also}
    others = [c for c in look.candidates if c.names]
    level = _fit_level(problem, soil, soil_alone, selected, starts, under_noise, others)
    again = _from_soils_of(problem, soil_alone, level, starts)
    if again is not soil_alone:
        gains = predicted_with_and_without(problem, again, soil, signatures)
    fitted |= {c.names: c for c in [again, *level]}
    nothing = explained_nothing(problem, fitted)
    nothing |= {n for n in look.without_gain if (n,) not in fitted}
    look = replace(look, predicted_gain=gains, without_gain=nothing)
    return _concluded(problem, look, fitted, seed if singles == "all" else None)


def _concluded(
    problem: FitProblem,
    first: SearchResult,
    fitted: Mapping[tuple[str, ...], Explanation],
    seed: int | None,
) -> SearchResult:
    """The result of a search, from that of its first look and all candidates.

    Without a seed, what the best of them leaves is not tested.
    """
    candidates = tuple(sorted(fitted.values(), key=lambda c: c.objective))
    gains, alone = first.predicted_gain, fitted[()]
    accepted = explanations(candidates, for_decisions(candidates, gains, alone))
    test = first.final_test if seed is None else _test_residuals(problem, accepted[0], seed)
    return replace(
        first,
        accepted=accepted,
        candidates=candidates,
        final_test=test,
        posterior=posterior(candidates, gains, alone, problem.penalties),
    )


def _fit_soil_alone(problem: FitProblem, soil: Solution, starts: Starts) -> Explanation:
    """The empty set of effects: the soil alone with a smooth discrepancy."""
    first, amplitude = soil, np.ones(len(problem.readings.channels))
    if () in starts:
        first, amplitude = starts[()].fit, starts[()].amplitude
    near = first.linearisation
    started = StartedFit(soil.case, soil.coordinates, first.start_values(), near=near)
    marginal = fit_marginal(problem, [(started, amplitude)])[0]
    if marginal is None:  # it is feasible under noise alone
        marginal = MarginalFit(soil, problem.discrepancy.evidence(soil))
    return Explanation((), marginal)


def _from_soils_of(
    problem: FitProblem, soil_alone: Explanation, level: Sequence[Explanation], starts: Starts
) -> Explanation:
    """The soil alone, fitted from the soils of the best explanations too.

    It is each of them without its effects. Where the soil has several optima, that of the soil
    alone would otherwise be compared with better ones, and any effect be preferred to none. It is
    not fitted again from a soil that has stayed since an earlier search.
    """
    useful = soil_alone.best.evidence.value + SAME_OPTIMUM
    started = [
        (StartedFit(problem.case, problem.soil, c.fit.start_values(), useful=useful), c.amplitude)
        for c in sorted(level, key=lambda c: c.objective)[:SOILS_AGAIN]
        if c.names not in starts or not _is_same_soil(starts[c.names].fit, c.fit)
    ]
    fits = fit_marginal(problem, started, soil_alone.best.evidence.value)
    found = [Explanation((), m) for m in fits if m is not None]
    best = min([soil_alone, *found], key=lambda c: c.objective)
    return best if best.objective < soil_alone.objective - SAME_OPTIMUM else soil_alone


def _is_same_soil(one: Solution, other: Solution) -> bool:
    values = one.start_values()
    return all(
        abs(x - values[c.path]) < SAME_SOIL
        for c, x in zip(other.coordinates, other.x, strict=True)
        if not c.effect
    )


def _fit_level(
    problem: FitProblem,
    soil: Solution,
    soil_alone: Explanation,
    sets: Mapping[tuple[str, ...], Explanation],
    starts: Starts,
    under_noise: Set[str] = frozenset(),
    others: Sequence[Explanation] = (),
) -> list[Explanation]:
    """Fit sets of effects, each from the candidate that it extends, with free shapes in reach.

    under_noise: Effects that start under noise alone too, where they are the only one of a set.
    others: Candidates with effects that are fitted already.
    """
    requests = []
    for names, base in sets.items():
        base = starts.get(names, base)
        smaller = np.minimum(base.amplitude, soil_alone.amplitude)
        noise_start = None
        if len(names) == 1 and names[0] in under_noise:
            noise_start = {path: off_bounds(x) for path, x in soil.start_values().items()}
        fit = base.catalogue_law.fit
        requests.append(
            CandidateRequest(
                names, fit.start_values(), smaller, noise_start, near=fit.linearisation
            )
        )
    fitted = fit_candidates(
        problem, requests, min((c.best.evidence.value for c in others), default=np.inf)
    )
    if not fitted:
        return []
    lowest = min(c.objective for c in [soil_alone, *others, *fitted])
    least = min(
        (c.noise_only.objective for c in fitted if c.noise_only is not None), default=np.inf
    )
    notable = min(soil.objective - NOTABLE_GAIN, NOTABLE_RATIO * least)
    promising = [
        c
        for c in fitted
        if c.objective - SHAPE_GAIN_FACTOR * predicted_shape_gain(problem, c) < lowest
        or c.objective < lowest + WITHIN_REACH
        or (c.noise_only is not None and c.noise_only.objective < notable)
        or (c.names in starts and starts[c.names].shape_supported)
    ]
    known = {**sets, **starts}
    shaped = {c.names: c for c in fit_shapes(problem, promising, known, notable)}
    return [shaped.get(c.names, c) for c in fitted]


def off_bounds(x: float) -> float:
    """A coordinate of the soil nearer to the middle of its prior.

    Where an effect is missing, soil parameters are often at a bound, from which the fit with the
    effect would not move.
    """
    return 0.5 + INWARD * (x - 0.5)


def is_complete(problem: FitProblem, best: Explanation, known: SearchResult, seed: int) -> bool:
    """Whether effects leave neither a discrepancy nor anything that the catalogue explains.

    known: A result with the test of the residuals of its best explanation.
    """
    if not best.names or float(best.amplitude.max()) > 0.0:
        return False
    test = known.final_test if best is known.accepted[0] else _test_residuals(problem, best, seed)
    return test.p_value > COMPLETE_LEVEL


def _test_residuals(problem: FitProblem, candidate: Explanation, seed: int) -> ResidualTest:
    fit = candidate.fit
    return residual_test(problem, fit, problem.signatures_beside(fit), seed)


def _extensions(
    problem: FitProblem,
    level: Sequence[Explanation],
    lowest: float,
) -> dict[tuple[str, ...], Explanation]:
    """Sets with one more effect that should increase the evidence, and what they extend."""
    extended: dict[tuple[str, ...], Explanation] = {}
    in_reach = [c for c in level if c.objective < lowest + WITHIN_REACH]
    for candidate in sorted(in_reach, key=lambda c: c.objective)[:EXTENDED_SETS]:
        signatures = problem.signatures_beside(candidate.fit)
        gains = predicted_gains(problem, candidate, candidate.objective, signatures)
        promising = [n for n in gains if gains[n] > MIN_NET_GAIN]
        promising = sorted(promising, key=lambda n: -gains[n])[:EXTENSIONS]
        for name in promising:
            names = tuple(sorted((*candidate.names, name)))
            extended.setdefault(names, candidate)
    return extended
