"""Candidate fits: effects by their catalogue law, and with the shape of that law estimated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.gap.search.marginal_fits import MarginalFit, fit_marginal
from soilml.gap.search.problem import FitProblem, StartedFit
from soilml.gap.statistics.coordinates import EffectCoordinate, shape_coordinates
from soilml.gap.statistics.least_squares import GapFit
from soilml.numerics.subspaces import ROUNDING, column_space, project_out

Floats = NDArray[np.float64]

#: -2 ln of the prior odds of one effect: one in twenty, for a catalogue of about twenty.
EFFECT_PENALTY = 2.0 * float(np.log(20.0))


@dataclass(frozen=True)
class CandidateFit:
    """A set of effects with two fits: by their catalogue laws, and with shape coefficients free.

    Both fits are the same one where no shape was estimated. The empty set is the soil alone.
    """

    names: tuple[str, ...]
    catalogue_law: MarginalFit
    free_law: MarginalFit

    @property
    def shape_supported(self) -> bool:
        """Whether the data support another law than the catalogue's."""
        return self.free_law.evidence.value < self.catalogue_law.evidence.value

    @property
    def best(self) -> MarginalFit:
        """The fit of larger evidence."""
        return self.free_law if self.shape_supported else self.catalogue_law

    @property
    def fit(self) -> GapFit:
        """The optimum of larger evidence."""
        return self.best.fit

    @property
    def amplitude(self) -> Floats:
        """Amplitude of the remaining discrepancy by channel, in usual ones."""
        return self.best.evidence.amplitude

    @property
    def objective(self) -> float:
        """-2 ln of the posterior probability, up to a constant that all candidates share."""
        return self.best.evidence.value + EFFECT_PENALTY * len(self.names)

    @property
    def shape_deviation(self) -> float:
        """Squared distance of the shapes from the catalogue's law, in prior variances."""
        x, precision = self.fit.x, self.fit.precision
        shapes = [
            i
            for i, c in enumerate(self.fit.coordinates)
            if isinstance(c, EffectCoordinate) and c.is_shape
        ]
        return float(np.sum(x[shapes] ** 2 * precision[shapes]))


def fit_candidates(
    problem: FitProblem,
    requests: Sequence[tuple[tuple[str, ...], Mapping[str, float], Floats]],
) -> list[CandidateFit]:
    """Fit sets of effects jointly with the soil, each effect by its catalogue law.

    A request has the names of the effects, start coordinates by path, and the amplitudes of the
    discrepancy by channel to start with. Sets that the model refuses are left out.
    """
    started = [
        (
            StartedFit(
                problem.with_effects(names),
                [*problem.soil, *problem.size_coordinates(names)],
                start,
            ),
            amplitude,
        )
        for names, start, amplitude in requests
    ]
    marginal = fit_marginal(problem, started)
    return [
        CandidateFit(names, fit, fit)
        for (names, _, _), fit in zip(requests, marginal, strict=True)
        if fit is not None
    ]


def fit_shapes(problem: FitProblem, candidates: Sequence[CandidateFit]) -> list[CandidateFit]:
    """The candidates with the shape coefficients of their effects estimated as well."""
    started, index = [], []
    for i, candidate in enumerate(candidates):
        fit = candidate.catalogue_law.fit
        if shapes := problem.shape_coordinates(candidate.names):
            coordinates = [*fit.coordinates, *shapes]
            started.append(
                (StartedFit(fit.case, coordinates, fit.start_values()), candidate.amplitude)
            )
            index.append(i)
    fitted = list(candidates)
    for i, marginal in zip(index, fit_marginal(problem, started), strict=True):
        if marginal is not None:
            fitted[i] = replace(candidates[i], free_law=marginal)
    return fitted


def shape_directions(problem: FitProblem, fit: GapFit) -> list[Floats]:
    """Changes of the readings by second-order terms in the laws of a fit's effects, (m, k) each.

    The signature of each size times s^2, s w or w^2, with slip s and log load w centred, in the
    readings' unit. The estimated shapes cover the first order alone.
    """
    signatures = [
        fit.derivatives[:, i]
        for i, c in enumerate(fit.coordinates)
        if isinstance(c, EffectCoordinate)
        and shape_coordinates(problem.effects[c.effect])
        and not c.is_shape
    ]
    if not signatures:
        return []
    s, w = problem.readings.slip, np.log(problem.readings.load)
    s, w = s - s.mean(), w - w.mean()
    columns = np.stack(signatures, axis=1)
    return [columns * term[:, None] for term in (s * s, s * w, w * w)]


def predicted_shape_gain(problem: FitProblem, candidate: CandidateFit) -> float:
    """Upper bound of the improvement by free shapes: linearised and without a prior."""
    fit = candidate.catalogue_law.fit
    whiten = problem.discrepancy.whiten(candidate.catalogue_law.evidence.amplitude)
    terms = (problem.readings.slip, np.log(problem.readings.load))
    signatures = fit.derivatives[:, len(problem.soil) :]
    columns = np.column_stack([signatures * term[:, None] for term in terms])
    projected = project_out(whiten @ columns, fit.jacobian)
    basis = column_space(projected, relative_tolerance=ROUNDING)
    return float(np.sum((basis.T @ fit.residual) ** 2))
