"""Stepwise search for missing effects: add, exchange and remove until only noise remains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.gap.search.candidate_fits import (
    CandidateFit,
    fit_candidate,
    fit_shapes,
    predicted_shape_gain,
    shape_directions,
)
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.score_test import ScoreTest, score_test
from soilml.gap.statistics.signatures import Signature, Untestable, effect_signatures
from soilml.gap.statistics.smooth_basis import smooth_basis
from soilml.numerics.subspaces import project_out

Floats = NDArray[np.float64]

#: Family-wise significance level of the test for a gap.
GAP_LEVEL = 0.03
#: Significance level of the test for lack of fit of a candidate.
LACK_OF_FIT_LEVEL = 0.001
#: Objective above that of the best candidate from which another one is rejected: 3 sigma for one
#: degree of freedom.
REJECTION_THRESHOLD = 9.0
#: Decrease of the objective that a further effect must achieve: above the rejection threshold,
#: because the effect is chosen from the whole catalogue.
MIN_IMPROVEMENT = 12.0
#: Effects are fitted in full if their predicted gain is above 2 sigma squared and within this
#: margin of the largest, and so many of the largest in any case.
MIN_GAIN, GAIN_MARGIN, MIN_FITTED = 4.0, 15.0, 6
#: Largest number of effects in a candidate; sets that are extended by one effect in each step, and
#: effects that each of them is extended by.
MAX_EFFECTS, EXTENDED_SETS, EXTENSIONS = 3, 3, 3
#: Upper bound of the improvement by free shapes, in linearised gains; the full fit can exceed the
#: linearised gain because the size changes with the shape.
SHAPE_GAIN_FACTOR = 3.0
#: Size, in reference sizes, at which a gain is predicted where the estimate has an impossible sign.
SMALL_SIZE = 0.02

#: Start coordinates by path, for each set of effect names.
Starts = Mapping[tuple[str, ...], Mapping[str, float]]


@dataclass(frozen=True)
class ResidualTest:
    """Score test of a fit's residuals against the catalogue and smooth functions together."""

    signatures: tuple[Signature, ...]
    test: ScoreTest

    @property
    def p_value(self) -> float:
        """Family-wise p value of the largest score."""
        return self.test.family_wise_p


@dataclass(frozen=True)
class SearchResult:
    """Result of the search; `final_test` is that of the best candidate, or of the soil alone."""

    soil: GapFit
    soil_test: ResidualTest
    #: candidates that are not rejected against the best one, in order of their objective
    accepted: tuple[CandidateFit, ...]
    #: all candidates that were fitted
    candidates: tuple[CandidateFit, ...]
    final_test: ResidualTest
    predicted_gain: dict[str, float]
    #: effects that these runs cannot test
    untestable: tuple[Untestable, ...] = ()

    @property
    def has_gap(self) -> bool:
        """Whether the fit of the soil alone is rejected."""
        return self.soil_test.p_value < GAP_LEVEL

    @property
    def adequate(self) -> bool:
        """Whether the residuals of the best candidate are consistent with noise."""
        return self.final_test.p_value >= LACK_OF_FIT_LEVEL


def residual_test(
    problem: FitProblem, fit: GapFit, signatures: Sequence[Signature], seed: int
) -> ResidualTest:
    """Test the residuals of a fit, with all that its coordinates can explain projected out.

    Second-order terms in the laws of the effects in the fit are projected out too; see
    `soilml.gap.search.candidate_fits.shape_directions`.
    """
    whiten = problem.covariance.whiten
    smooth = smooth_basis(problem.readings)
    columns = whiten @ np.column_stack([*[s.column for s in signatures], smooth])
    signs = np.asarray([s.sign for s in signatures] + [0] * smooth.shape[1], dtype=np.float64)
    space = np.column_stack([fit.jacobian, *shape_directions(problem, fit)])
    degrees_of_freedom = problem.covariance.components.degrees_of_freedom
    test = score_test(fit.residual, columns, space, signs, degrees_of_freedom, seed)
    return ResidualTest(tuple(signatures), test)


def predicted_gains(
    problem: FitProblem, fit: GapFit, signatures: Sequence[Signature]
) -> dict[str, float]:
    """Decrease of the objective that each effect, with free shape, should achieve: linearised."""
    whiten = problem.covariance.whiten
    slip, load = problem.readings.slip, np.log(problem.readings.load)
    terms = [np.ones_like(slip), slip - slip.mean(), load - load.mean()]
    gains = {}
    for s in signatures:
        shapes = problem.shape_coordinates([s.name])
        columns = np.stack([s.column * term for term in terms[: 1 + len(shapes)]], axis=1)
        projected = project_out(whiten @ columns, fit.jacobian)
        main = projected[:, 0]
        power = float(main @ main)
        if power <= 0.0:
            gains[s.name] = 0.0
            continue
        size = float(main @ fit.residual) / power
        if s.sign and size * s.sign <= 0:
            size = SMALL_SIZE * s.sign
        std = problem.size_coordinates([s.name])[0].std
        precision = np.asarray([std**-2, *[(shape.std * size) ** -2 for shape in shapes]])
        normal = projected.T @ projected + np.diag(precision)
        moment = projected.T @ fit.residual
        gains[s.name] = float(moment @ np.linalg.solve(normal, moment))
    return gains


def search(
    problem: FitProblem, soil: GapFit, seed: int, starts: Starts | None = None
) -> SearchResult:
    """Search for the effects that explain what the soil alone does not.

    Candidates are fitted jointly with the soil, by their catalogue law; where it could bring them
    close to the best, with free shapes too. While the residuals of the best candidate are
    inconsistent with noise, the best sets are extended by one effect. A set is replaced by a
    smaller one that explains the data nearly as well.

    Parameters
    ----------
    starts : mapping
        Start coordinates by effect names, from an earlier search.
    """
    starts = starts or {}
    signatures, untestable = effect_signatures(soil.fitted(), problem.readings, problem.effects)
    soil_test = residual_test(problem, soil, signatures, seed)
    gains = predicted_gains(problem, soil, signatures)
    nothing = SearchResult(soil, soil_test, (), (), soil_test, gains, tuple(untestable))
    if not nothing.has_gap:
        return nothing
    start = soil.start_values()
    level = _with_free_shapes(
        problem,
        [fit_candidate(problem, [n], starts.get((n,), start)) for n in _select_by_gain(gains)],
    )
    fitted = {c.names: c for c in level}
    level = [c for c in level if c.objective < soil.objective - MIN_IMPROVEMENT / 2]
    if not level:
        return nothing
    best = min(level, key=lambda c: c.objective)
    test = _test_residuals(problem, best, seed)
    for _ in range(MAX_EFFECTS - 1):
        if test.p_value >= LACK_OF_FIT_LEVEL:
            break
        larger = _with_free_shapes(problem, _add_one_effect(problem, level, fitted, starts))
        fitted |= {c.names: c for c in larger}
        if not larger:
            break
        better = min(larger, key=lambda c: c.objective)
        if better.objective > best.objective - MIN_IMPROVEMENT:
            break
        level, best = larger, better
        test = _test_residuals(problem, best, seed)
    smaller = _drop_effects(problem, best, fitted)
    if smaller is not None:
        best, test = smaller, _test_residuals(problem, smaller, seed)
    level = [c for c in fitted.values() if len(c.names) == len(best.names)]
    accepted = [c for c in level if c.objective <= best.objective + REJECTION_THRESHOLD]
    accepted.sort(key=lambda c: c.objective)
    return replace(
        nothing, accepted=tuple(accepted), candidates=tuple(fitted.values()), final_test=test
    )


def _with_free_shapes(
    problem: FitProblem, candidates: Sequence[CandidateFit]
) -> list[CandidateFit]:
    """The candidates, with free shapes where that could bring them close to the best."""
    fitted: list[CandidateFit] = []
    lowest = np.inf
    for candidate in sorted(candidates, key=lambda c: c.objective):
        bound = candidate.objective - SHAPE_GAIN_FACTOR * predicted_shape_gain(problem, candidate)
        promising = bound < lowest + REJECTION_THRESHOLD
        result = fit_shapes(problem, candidate) if promising else candidate
        lowest = min(lowest, result.objective)
        fitted.append(result)
    return fitted


def _test_residuals(problem: FitProblem, candidate: CandidateFit, seed: int) -> ResidualTest:
    fit = candidate.fit
    signatures, _ = effect_signatures(fit.fitted(), problem.readings, problem.effects_not_in(fit))
    return residual_test(problem, fit, signatures, seed)


def _drop_effects(
    problem: FitProblem, best: CandidateFit, fitted: dict[tuple[str, ...], CandidateFit]
) -> CandidateFit | None:
    """A smaller set that explains the data nearly as well; None where every effect is needed."""
    smallest = None
    while len(best.names) > 1:
        subsets = [tuple(n for n in best.names if n != out) for out in best.names]
        for names in subsets:
            if names not in fitted:
                candidate = fit_candidate(problem, names, best.catalogue_fit.start_values())
                fitted[names] = _with_free_shapes(problem, [candidate])[0]
        least = min((fitted[names] for names in subsets), key=lambda c: c.objective)
        if least.objective > best.objective + MIN_IMPROVEMENT:
            break
        smallest = best = least
    return smallest


def _select_by_gain(gains: Mapping[str, float]) -> list[str]:
    """Effects to fit in full, in order of their predicted gain."""
    ordered = [n for n in sorted(gains, key=lambda name: -gains[name]) if gains[n] > MIN_GAIN]
    if not ordered:
        return []
    close = [n for n in ordered if gains[n] > gains[ordered[0]] - GAIN_MARGIN]
    return ordered[: max(MIN_FITTED, len(close))]


def _add_one_effect(
    problem: FitProblem,
    level: Sequence[CandidateFit],
    fitted: Mapping[tuple[str, ...], CandidateFit],
    starts: Starts,
) -> list[CandidateFit]:
    """The best sets of this level, each extended by the effects of largest predicted gain."""
    extended: dict[tuple[str, ...], CandidateFit] = {}
    for candidate in sorted(level, key=lambda c: c.objective)[:EXTENDED_SETS]:
        fit = candidate.fit
        others = problem.effects_not_in(fit)
        signatures, _ = effect_signatures(fit.fitted(), problem.readings, others)
        gains = predicted_gains(problem, fit, signatures)
        for name in _select_by_gain(gains)[:EXTENSIONS]:
            names = tuple(sorted((*candidate.names, name)))
            if names not in extended and names not in fitted:
                start = starts.get(names, candidate.catalogue_fit.start_values())
                extended[names] = fit_candidate(problem, names, start)
    return list(extended.values())
