"""Stepwise search for missing effects, by their evidence beside a smooth discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.effect_signatures import Signature
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.directions import smooth_basis
from soilml.gap.evidence.problem import (
    FitProblem,
    MarginalFit,
    StartedFit,
    fit_marginal,
    within_bounds,
)
from soilml.gap.evidence.score_test import ScoreTest, score_test
from soilml.gap.search.explanation import (
    CandidateRequest,
    Explanation,
    fit_candidates,
    fit_shapes,
    predicted_shape_gain,
    shape_directions,
)
from soilml.gap.search.posterior import Posterior, explanations, for_decisions, posterior
from soilml.gap.search.screening import (
    LARGE_DISCREPANCY,
    WITHIN_REACH,
    Starts,
    effects_to_fit,
    likeliest_sets,
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
#: Decrease of the sum of squares under noise alone from which the free law of an effect is tried.
NOTABLE_GAIN = 20.0
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

    @property
    def has_gap(self) -> bool:
        """Whether the fit of the soil alone is rejected."""
        return self.soil_test.p_value < GAP_LEVEL

    @property
    def adequate(self) -> bool:
        """Whether the residuals of the best explanation are consistent with noise."""
        return self.final_test.p_value >= LACK_OF_FIT_LEVEL

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
    first_look: bool = False,
) -> SearchResult:
    """Search for the effects that explain what the soil alone does not.

    Candidates are fitted jointly with the soil, by their catalogue law; where it could bring them
    close to the best, with free shapes too. Sets within reach of the best are extended by one
    effect while that increases the evidence.

    soil: The soil alone, fitted under noise and scatter without discrepancy.
    starts: Candidates of an earlier search.
    progress: Called with the share of the search that is done, from 0 to 1.
    first_look: Fit single effects and the likeliest of `starts`, and extend none of them.
    """
    starts = starts or {}
    signatures, untestable = problem.signatures_and_untestable(soil)
    soil_test = residual_test(problem, soil, signatures, seed, within_priors=True)
    if soil_test.p_value >= GAP_LEVEL:
        return without_search(soil, soil_test, untestable)
    progress(1 / STEPS)
    soil_alone = _fit_soil_alone(problem, soil, starts)
    gains = predicted_with_and_without(problem, soil_alone, soil, signatures)
    fitted: dict[tuple[str, ...], Explanation] = {(): soil_alone}
    singles = effects_to_fit(problem, soil_alone, soil, signatures, gains=gains, starts=starts)
    selected: list[tuple[str, ...]] = [(name,) for name in singles]
    if first_look:
        selected = list(dict.fromkeys([*likeliest_sets(starts), *selected]))
    level = _fit_level(problem, soil, soil_alone, dict.fromkeys(selected, soil_alone), starts)
    fitted |= {c.names: c for c in level}
    again = _from_soils_of(problem, soil_alone, level)
    if again is not soil_alone:
        gains = predicted_with_and_without(problem, again, soil, signatures)
        soil_alone = fitted[()] = again
    for effects in range(1, 1 if first_look else MAX_EFFECTS):
        progress((1 + effects) / STEPS)
        best = min(fitted.values(), key=lambda c: c.objective)
        if best.names and _is_complete(problem, best, seed):
            break
        lowest = best.objective
        extensions = _extensions(problem, level, fitted, lowest)
        level = _fit_level(problem, soil, soil_alone, extensions, starts)
        fitted |= {c.names: c for c in level}
        if not level or min(c.objective for c in level) > lowest - MIN_IMPROVEMENT:
            break
    candidates = tuple(sorted(fitted.values(), key=lambda c: c.objective))
    found = posterior(candidates, gains, soil_alone, problem.penalties)
    accepted = explanations(candidates, for_decisions(candidates, gains, soil_alone))
    return SearchResult(
        soil=soil,
        soil_test=soil_test,
        accepted=accepted,
        candidates=candidates,
        final_test=_test_residuals(problem, accepted[0], seed),
        predicted_gain=gains,
        posterior=found,
        untestable=untestable,
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
    problem: FitProblem, soil_alone: Explanation, level: Sequence[Explanation]
) -> Explanation:
    """The soil alone, fitted from the soils of the best explanations too.

    It is each of them without its effects. Where the soil has several optima, that of the soil
    alone would otherwise be compared with better ones, and any effect be preferred to none.
    """
    started = [
        (StartedFit(problem.case, problem.soil, c.fit.start_values()), c.amplitude)
        for c in sorted(level, key=lambda c: c.objective)[:SOILS_AGAIN]
    ]
    found = [Explanation((), m) for m in fit_marginal(problem, started) if m is not None]
    best = min([soil_alone, *found], key=lambda c: c.objective)
    return best if best.objective < soil_alone.objective - SAME_OPTIMUM else soil_alone


def _fit_level(
    problem: FitProblem,
    soil: Solution,
    soil_alone: Explanation,
    sets: Mapping[tuple[str, ...], Explanation],
    starts: Starts,
) -> list[Explanation]:
    """Fit sets of effects, each from the candidate that it extends, with free shapes in reach.

    Beside a large discrepancy, single effects are fitted under noise alone first.
    """
    hidden = float(soil_alone.amplitude.max()) >= LARGE_DISCREPANCY
    single = all(not base.names for base in sets.values())
    requests = []
    for names, base in sets.items():
        base = starts.get(names, base)
        smaller = np.minimum(base.amplitude, soil_alone.amplitude)
        noise_start = None
        if hidden and single:
            alone = base.noise_only
            noise_start = {path: off_bounds(x) for path, x in soil.start_values().items()}
            if alone is not None:
                noise_start = alone.start_values()
        fit = base.catalogue_law.fit
        requests.append(
            CandidateRequest(
                names, fit.start_values(), smaller, noise_start, near=fit.linearisation
            )
        )
    fitted = fit_candidates(problem, requests)
    if not fitted:
        return []
    lowest = min(soil_alone.objective, *(c.objective for c in fitted))
    notable = soil.objective - NOTABLE_GAIN
    promising = [
        c
        for c in fitted
        if c.objective - SHAPE_GAIN_FACTOR * predicted_shape_gain(problem, c) < lowest
        or c.objective < lowest + WITHIN_REACH
        or (c.noise_only is not None and c.noise_only.objective < notable)
    ]
    shaped = {c.names: c for c in fit_shapes(problem, promising, notable)}
    return [shaped.get(c.names, c) for c in fitted]


def off_bounds(x: float) -> float:
    """A coordinate of the soil nearer to the middle of its prior.

    Where an effect is missing, soil parameters are often at a bound, from which the fit with the
    effect would not move.
    """
    return 0.5 + INWARD * (x - 0.5)


def _is_complete(problem: FitProblem, best: Explanation, seed: int) -> bool:
    """Whether a candidate leaves neither a discrepancy nor anything that the catalogue explains."""
    if float(best.amplitude.max()) > 0.0:
        return False
    return _test_residuals(problem, best, seed).p_value > COMPLETE_LEVEL


def _test_residuals(problem: FitProblem, candidate: Explanation, seed: int) -> ResidualTest:
    fit = candidate.fit
    return residual_test(problem, fit, problem.signatures_beside(fit), seed)


def _extensions(
    problem: FitProblem,
    level: Sequence[Explanation],
    fitted: Mapping[tuple[str, ...], Explanation],
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
            if names not in fitted and names not in extended:
                extended[names] = candidate
    return extended


def _degrees_by_runs(problem: FitProblem, signatures: Sequence[Signature], others: int) -> Floats:
    """Degrees of freedom by which each signature is judged; infinite but for drifts of the soil.

    A drift differs from the scatter of the runs only by its order: a line through them leaves two
    fewer than there are runs.
    """
    left = max(len(problem.readings.runs) - 2, 1)
    drifts = ["progress" in problem.effects[s.name].about.uses for s in signatures]
    return np.asarray([left if drift else np.inf for drift in drifts] + [np.inf] * others)


@dataclass(frozen=True)
class ResidualTest:
    """Score test of a fit's residuals, and the signatures against which they were tested."""

    signatures: tuple[Signature, ...]
    test: ScoreTest

    @property
    def p_value(self) -> float:
        """Family-wise p value of the largest score."""
        return self.test.family_wise_p


def residual_test(
    problem: FitProblem,
    fit: Solution,
    signatures: Sequence[Signature],
    seed: int,
    *,
    within_priors: bool = False,
) -> ResidualTest:
    """Test the residuals of a fit against noise, scatter and the declared discrepancy, if any.

    All that the coordinates of the fit can explain is projected out, with second-order terms in
    the laws of its effects; see `soilml.gap.search.explanation.shape_directions`. What another
    soil could explain is, with tests of the soil, what these permit.

    within_priors: Do not project out coordinates of the soil that the fit presses against a bound:
        a soil that the priors exclude explains nothing.
    """
    whiten = problem.discrepancy.whiten(problem.declared_amplitude)
    fit = fit.whitened_by(whiten)
    smooth = smooth_basis(problem.readings)
    columns = whiten @ np.column_stack([*[s.column for s in signatures], smooth])
    signs = np.asarray([s.sign for s in signatures] + [0] * smooth.shape[1], dtype=np.float64)
    directions = [whiten @ columns for columns in shape_directions(problem, fit)]
    jacobian = within_bounds(fit) if within_priors else fit.jacobian
    space = np.column_stack([jacobian, *directions])
    # tests of the soil are residuals that no effect changes: a change of the soil costs something
    deviation, rates = fit.soil_tests.deviation(fit.x), fit.soil_tests.rates(fit.x)
    tests, k = len(deviation), len(fit.x)
    columns = np.vstack([columns, np.zeros((tests, columns.shape[1]))])
    space = np.vstack([space, np.hstack([rates, np.zeros((tests, space.shape[1] - k))])])
    residual = np.append(fit.residual, -deviation)
    test = score_test(
        residual,
        columns=columns,
        space=space,
        signs=signs,
        degrees_of_freedom=problem.covariance.components.degrees_of_freedom,
        seed=seed,
        own_degrees=_degrees_by_runs(problem, signatures, smooth.shape[1]),
    )
    return ResidualTest(tuple(signatures), test)
