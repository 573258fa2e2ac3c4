"""Explanations: sets of effects fitted by their catalogue law, and with its shape estimated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.coordinates import shape_coordinates
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import Linearisation
from soilml.gap.evidence.problem import (
    FitProblem,
    MarginalFit,
    StartedFit,
    fit_marginal,
    restated,
)
from soilml.numerics.subspaces import ROUNDING, column_space, project_out

#: Evidence, in -2 ln p above that of the catalogue's law, from which a coarse fit of free shapes
#: stays coarse: a fine one seldom lowers it by that much.
NEARLY_SUPPORTED = 2.0


@dataclass(frozen=True)
class Explanation:
    """A set of effects with its fits; the empty set is the soil alone.

    It is what a search fits, what is accepted or suspected, and what a verdict claims.
    """

    names: tuple[str, ...]
    catalogue_law: MarginalFit
    #: with the shapes of the laws free, where they were estimated
    free_law: MarginalFit | None = None
    #: where the catalogue's law explains most under noise alone, as another start of the free law
    noise_only: Solution | None = None
    #: -2 ln of the prior odds of its effects against the soil alone
    penalty: float = 0.0

    @property
    def shape_supported(self) -> bool:
        """Whether the data support another law than the catalogue's."""
        free = self.free_law
        return free is not None and free.evidence.value < self.catalogue_law.evidence.value

    @property
    def best(self) -> MarginalFit:
        """The fit of larger evidence."""
        return (self.shape_supported and self.free_law) or self.catalogue_law

    @property
    def fit(self) -> Solution:
        """The optimum of larger evidence."""
        return self.best.fit

    @property
    def amplitude(self) -> Floats:
        """Amplitude of the remaining discrepancy by channel, in usual ones."""
        return self.best.evidence.amplitude

    @property
    def objective(self) -> float:
        """-2 ln of the posterior probability, up to a constant that all candidates share."""
        return self.best.evidence.value + self.penalty

    @property
    def shape_deviation(self) -> float:
        """Squared distance of the shapes from the catalogue's law, in prior variances."""
        x, precision = self.fit.x, self.fit.precision
        shapes = [i for i, c in enumerate(self.fit.coordinates) if c.effect and c.is_shape]
        return float(np.sum(x[shapes] ** 2 * precision[shapes]))


@dataclass(frozen=True)
class CandidateRequest:
    """A set of effects to be fitted.

    `start` has the coordinates to start with by path, and `amplitude` those of the discrepancy by
    channel. `noise_start` are those to start with under noise alone, if that is asked for. `near`
    is a linearisation where `start` was taken from.
    """

    names: tuple[str, ...]
    start: Mapping[str, float]
    amplitude: Floats
    noise_start: Mapping[str, float] | None = None
    near: Linearisation | None = None


def fit_candidates(
    problem: FitProblem, requests: Sequence[CandidateRequest], lowest: float = np.inf
) -> list[Explanation]:
    """Fit sets of effects jointly with the soil, each effect by its catalogue law.

    With `noise_start`, a set is also fitted under noise alone, and from there beside a discrepancy:
    beside a large one, a fit can stay where the effect is not needed. Sets that the
    model refuses are left out.

    lowest: Evidence of the best candidate so far.
    """
    no_discrepancy = np.zeros(len(problem.readings.channels))
    beside = [
        (replace(_started(problem, r.names, r.start), near=r.near), r.amplitude) for r in requests
    ]
    alone = [
        (_started(problem, r.names, r.noise_start), no_discrepancy)
        for r in requests
        if r.noise_start is not None
    ]
    marginal = iter(fit_marginal(problem, [*beside, *alone], lowest))
    found = [next(marginal) for _ in requests]
    from_noise = [next(marginal) if r.noise_start is not None else None for r in requests]
    candidates = []
    for request, first, second in zip(requests, found, from_noise, strict=True):
        best = _better(first, second)
        if best is not None:
            noise_only = second.first if second else None
            penalty = problem.penalty(request.names)
            candidates.append(Explanation(request.names, best, None, noise_only, penalty))
    return candidates


def _started(problem: FitProblem, names: tuple[str, ...], start: Mapping[str, float]) -> StartedFit:
    coordinates = [*problem.soil, *problem.size_coordinates(names)]
    return StartedFit(problem.with_effects(names), coordinates, start)


def _better(first: MarginalFit | None, second: MarginalFit | None) -> MarginalFit | None:
    """The fit of larger evidence."""
    if first is None or second is None:
        return first or second
    return first if first.evidence.value <= second.evidence.value else second


def fit_shapes(
    problem: FitProblem,
    candidates: Sequence[Explanation],
    starts: Mapping[tuple[str, ...], Explanation] | None = None,
    limit: float = np.inf,
) -> list[Explanation]:
    """The candidates with the shape coefficients of their effects estimated as well.

    starts: Candidates of an earlier search, or those that these extend by one effect. Their free
        laws are starts of these.
    limit: Objective from which fits under noise alone are no further starts.
    """
    started, index = [], []
    no_discrepancy = np.zeros(len(problem.readings.channels))
    for i, candidate in enumerate(candidates):
        shapes = problem.shape_coordinates(candidate.names)
        first = [(candidate.catalogue_law.fit, candidate.amplitude)]
        alone = candidate.noise_only
        same = alone is candidate.catalogue_law.fit and not candidate.amplitude.any()
        if alone is not None and alone.objective < limit and not same:
            first.append((alone, no_discrepancy))
        earlier = (starts or {}).get(candidate.names)
        if earlier is not None and earlier.free_law is not None:
            first = [(earlier.free_law.fit, earlier.free_law.evidence.amplitude)]
        for fit, amplitude in first if shapes else []:
            own = candidate.catalogue_law.fit
            coordinates = [*own.coordinates, *shapes]
            start = {**own.start_values(), **fit.start_values()}
            useful = candidate.catalogue_law.evidence.value + NEARLY_SUPPORTED
            new = StartedFit(own.case, coordinates, start, near=fit.linearisation, useful=useful)
            started.append((new, amplitude))
            index.append(i)
    free: dict[int, MarginalFit | None] = {}
    lowest = min((c.best.evidence.value for c in candidates), default=np.inf)
    for i, marginal in zip(index, fit_marginal(problem, started, lowest), strict=True):
        free[i] = _better(free.get(i), marginal)
    fitted = list(candidates)
    for i, best in free.items():
        if best is not None:
            fitted[i] = replace(candidates[i], free_law=best)
    return fitted


def restated_candidates(
    problem: FitProblem, candidates: Sequence[Explanation]
) -> dict[tuple[str, ...], Explanation]:
    """Candidates of an earlier problem by their effects, with fits as `restated` has them.

    Without those under noise alone, which are starts in the first search only.
    """
    fits = [c.catalogue_law.fit for c in candidates]
    fits += [c.free_law.fit for c in candidates if c.free_law is not None]
    new = dict(zip(map(id, fits), restated(problem, fits), strict=True))

    def again(law: MarginalFit | None) -> MarginalFit | None:
        return law and replace(law, fit=new[id(law.fit)])

    return {
        c.names: replace(
            c,
            catalogue_law=replace(c.catalogue_law, fit=new[id(c.catalogue_law.fit)]),
            free_law=again(c.free_law),
            noise_only=None,
        )
        for c in candidates
    }


def shape_directions(problem: FitProblem, fit: Solution) -> list[Floats]:
    """Changes of the readings by second-order terms in the laws of a fit's effects, (m, k) each.

    The signature of each size times s^2, s w or w^2, with log slip s and log load w centred, in the
    readings' unit. The estimated shapes cover the first order alone.
    """
    signatures = [
        fit.derivatives[:, i]
        for i, c in enumerate(fit.coordinates)
        if c.effect and shape_coordinates(problem.effects[c.effect]) and not c.is_shape
    ]
    if not signatures:
        return []
    s, w = problem.readings.log_slip_and_load
    s, w = s - s.mean(), w - w.mean()
    columns = np.stack(signatures, axis=1)
    return [columns * term[:, None] for term in (s * s, s * w, w * w)]


def predicted_shape_gain(problem: FitProblem, candidate: Explanation) -> float:
    """Upper bound of the improvement by free shapes: linearised and without a prior."""
    fit = candidate.catalogue_law.fit
    whiten = problem.discrepancy.whiten(candidate.catalogue_law.evidence.amplitude)
    signatures = fit.derivatives[:, len(problem.soil) :]
    terms = (problem.readings.slip, *problem.readings.log_slip_and_load)
    columns = np.column_stack([signatures * term[:, None] for term in terms])
    projected = project_out(whiten @ columns, fit.jacobian)
    basis = column_space(projected, relative_tolerance=ROUNDING)
    return float(np.sum((basis.T @ fit.residual) ** 2))
