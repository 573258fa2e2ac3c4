"""Candidate fits: effects by their catalogue law, and with the shape of that law estimated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.coordinates import EffectCoordinate, shape_coordinates
from soilml.gap.statistics.least_squares import GapFit
from soilml.numerics.subspaces import ROUNDING, column_space, project_out

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CandidateFit:
    """A set of effects with two fits: by their catalogue laws, and with shape coefficients free.

    Both fits are the same one where no shape was estimated.
    """

    names: tuple[str, ...]
    catalogue_fit: GapFit
    shape_fit: GapFit

    @property
    def occam_penalty(self) -> float:
        r"""Improvement that the shape coefficients must exceed: their Occam factor.

        .. math:: \sum_k \ln(1 + \sigma_k^2 / s_k^2)

        with the standard deviations of prior and posterior.

        References
        ----------
        MacKay, Neural Computation 4, 1992.
        """
        precision = self.shape_fit.precision
        shapes = _shape_indices(self.shape_fit)
        variance = np.diag(self.shape_fit.covariance)[shapes]
        return float(np.sum(np.log1p(1.0 / (precision[shapes] * np.maximum(variance, 1e-12)))))

    @property
    def shape_supported(self) -> bool:
        """Whether the data support another law than the catalogue's."""
        return self.shape_fit.objective + self.occam_penalty < self.catalogue_fit.objective

    @property
    def objective(self) -> float:
        """The lower objective of the two fits, with the Occam penalty for free shapes."""
        return min(self.catalogue_fit.objective, self.shape_fit.objective + self.occam_penalty)

    @property
    def fit(self) -> GapFit:
        """The fit with that objective."""
        return self.shape_fit if self.shape_supported else self.catalogue_fit

    @property
    def shape_deviation(self) -> float:
        """Squared distance of the shapes from the catalogue's law, in prior variances."""
        x, precision = self.fit.x, self.fit.precision
        shapes = _shape_indices(self.fit)
        return float(np.sum(x[shapes] ** 2 * precision[shapes]))


def fit_candidate(
    problem: FitProblem, names: Sequence[str], start: Mapping[str, float]
) -> CandidateFit:
    """Fit these effects jointly with the soil, each by its catalogue law."""
    coordinates = [*problem.soil, *problem.size_coordinates(names)]
    fit = problem.fit(problem.with_effects(names), coordinates, start)
    return CandidateFit(tuple(names), fit, fit)


def fit_shapes(problem: FitProblem, candidate: CandidateFit) -> CandidateFit:
    """The candidate with the shape coefficients of its effects estimated as well."""
    catalogue = candidate.catalogue_fit
    shapes = problem.shape_coordinates(candidate.names)
    if not shapes:
        return candidate
    fit = problem.fit(catalogue.case, [*catalogue.coordinates, *shapes], catalogue.start_values())
    worse = fit.objective > catalogue.objective
    return candidate if worse else replace(candidate, shape_fit=fit)


def shape_directions(problem: FitProblem, fit: GapFit) -> list[Floats]:
    """Changes of the readings by second-order terms in the laws of a fit's effects, whitened.

    Each is (m, k): the signature of each size times s^2, s w or w^2, with slip s and log load w
    centred. The estimated shapes cover the first order alone.
    """
    signatures = [
        fit.jacobian[:, i]
        for i, c in enumerate(fit.coordinates)
        if isinstance(c, EffectCoordinate)
        and shape_coordinates(problem.effects[c.effect])
        and not c.is_shape
    ]
    if not signatures:
        return []
    whiten = problem.covariance.whiten
    s, w = problem.readings.slip, np.log(problem.readings.load)
    s, w = s - s.mean(), w - w.mean()
    plain = np.linalg.solve(whiten, np.stack(signatures, axis=1))
    return [whiten @ (plain * term[:, None]) for term in (s * s, s * w, w * w)]


def predicted_shape_gain(problem: FitProblem, candidate: CandidateFit) -> float:
    """Upper bound of the improvement by free shapes: linearised and without a prior."""
    fit, whiten = candidate.catalogue_fit, problem.covariance.whiten
    terms = (problem.readings.slip, np.log(problem.readings.load))
    signatures = np.linalg.solve(whiten, fit.jacobian[:, len(problem.soil) :])
    columns = np.column_stack([signatures * term[:, None] for term in terms])
    projected = project_out(whiten @ columns, fit.jacobian)
    basis = column_space(projected, relative_tolerance=ROUNDING)
    return float(np.sum((basis.T @ fit.residual) ** 2))


def _shape_indices(fit: GapFit) -> list[int]:
    return [
        i for i, c in enumerate(fit.coordinates) if isinstance(c, EffectCoordinate) and c.is_shape
    ]
