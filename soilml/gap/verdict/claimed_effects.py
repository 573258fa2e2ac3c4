"""Figures of a verdict: estimates, separation of effects, and where the model disagrees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.coordinates import EffectCoordinate, SoilCoordinate
from soilml.fitting.least_squares import Solution
from soilml.gap.report_parts import Discrepancy, EstimatedValue, NamedEffect
from soilml.gap.search.candidate_fits import CandidateFit
from soilml.gap.search.posterior import Posterior
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.score_test import score_test
from soilml.gap.statistics.signatures import effect_signatures
from soilml.gap.statistics.smooth_basis import regions
from soilml.gap.verdict.estimate_spread import EstimateSpread
from soilml.numerics.subspaces import project_out
from soilml.quantities import column

Floats = NDArray[np.float64]


def soil_estimates(
    fit: Solution, spread: EstimateSpread | None = None
) -> dict[str, EstimatedValue]:
    """The soil parameters of a fit, by name.

    With `spread`, each standard deviation is that of the normal distribution whose 90 % interval
    is as wide as the one over all explanations.
    """
    values, stds = fit.values(), fit.stds()
    if spread is not None:
        stds = {path: spread.std(path, own) for path, own in stds.items()}
    return {
        c.name: EstimatedValue(values[c.path], stds[c.path], c.unit)
        for c in fit.coordinates
        if isinstance(c, SoilCoordinate)
    }


def effect_estimates(fit: Solution, effect: str) -> dict[str, EstimatedValue]:
    """The parameters of one effect of a fit, by name."""
    values, stds = fit.values(), fit.stds()
    return {
        c.name: EstimatedValue(values[c.path], stds[c.path], c.unit)
        for c in fit.coordinates
        if isinstance(c, EffectCoordinate) and c.effect == effect
    }


def named_effects(
    accepted: Sequence[CandidateFit],
    fit: Solution,
    similarity: SignatureSimilarity,
    posterior: Posterior,
) -> list[NamedEffect]:
    """The effects of the best candidate, with the effects of the other accepted candidates.

    `fit` is that of the best candidate, with its intervals.
    """
    best = accepted[0]
    alternatives = {n for c in accepted[1:] for n in c.names} - set(best.names)
    effects = []
    for name in best.names:
        snr, rival = similarity.separation(name, _size(best.fit, name))
        estimates = effect_estimates(fit, name)
        effects.append(
            NamedEffect(
                name,
                estimates,
                tuple(sorted(alternatives)),
                snr,
                rival,
                posterior.probability(name),
                posterior.effect_log_odds(name),
            )
        )
    return effects


def _size(fit: Solution, effect: str) -> float:
    """Size of an effect in reference sizes; its coordinate precedes those of its shape."""
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if isinstance(c, EffectCoordinate) and c.effect == effect:
            return float(x)
    return 0.0


@dataclass(frozen=True)
class SignatureSimilarity:
    """Norms (sigma) and cosines of the catalogue's signatures, with the soil projected out."""

    names: tuple[str, ...]
    norm: Floats  # (k,)
    cosine: Floats  # (k, k), absolute, with a zero diagonal

    def separation(self, name: str, size: float) -> tuple[float, str]:
        """Separating signal-to-noise ratio of an effect at a size, and its nearest rival.

        Norm of the effect's projected signature times the sine of the angle to the nearest
        rival's, in sigma; `size` is in reference sizes.
        """
        if name not in self.names:
            return 0.0, ""
        i = self.names.index(name)
        rival = int(np.argmax(self.cosine[i]))
        sine = float(np.sqrt(max(0.0, 1.0 - self.cosine[i, rival] ** 2)))
        return abs(size) * float(self.norm[i]) * sine, self.names[rival]

    def largest_cosine(self, names: Sequence[str]) -> float:
        """Largest cosine between the signature of one of these effects and that of another."""
        chosen = np.isin(self.names, names)
        if not chosen.any() or chosen.all():
            return 0.0
        return float(self.cosine[chosen][:, ~chosen].max())


def signature_similarity(
    problem: FitProblem, fit: Solution, amplitude: Floats
) -> SignatureSimilarity:
    """Similarity of the catalogue's signatures beside a discrepancy, on the soil of a fit.

    `amplitude` is that of the remaining discrepancy by channel, in usual ones.
    """
    whiten = problem.discrepancy.whiten(amplitude)
    values = fit.values()
    soil = {c.path: values[c.path] for c in fit.coordinates if isinstance(c, SoilCoordinate)}
    case = problem.case.with_values(soil)
    signatures, _ = effect_signatures(case, problem.readings, problem.effects)
    columns = whiten @ np.stack([s.column for s in signatures], axis=1)
    columns = project_out(columns, whiten @ fit.derivatives[:, : len(problem.soil)])
    norm = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(norm > 0, norm, 1.0)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    return SignatureSimilarity(tuple(s.name for s in signatures), norm, cosine)


def discrepancy_map(problem: FitProblem, fit: Solution, seed: int) -> list[Discrepancy]:
    """Score of each region of the data against the fit of the soil alone, the largest first.

    The score is positive where the mean reading is above the prediction.
    """
    parts = list(regions(problem.readings))
    if not parts:
        return []
    std = problem.covariance.std
    columns = np.stack([np.where(r.selected, std, 0.0) for r in parts], axis=1)
    fit = fit.whitened_by(problem.covariance.whiten)
    test = score_test(
        fit.residual,
        problem.covariance.whiten @ columns,
        fit.jacobian,
        np.zeros(len(parts)),
        problem.covariance.components.degrees_of_freedom,
        seed,
    )
    standardised = (problem.readings.reading - fit.prediction) / std
    found = []
    for i in np.argsort(-test.z):
        region, z = parts[i], float(test.z[i])
        side = float(np.mean(standardised[region.selected]))
        signed = float(np.copysign(z, side))
        found.append(
            Discrepancy(column(region.channel), region.slip, region.load, signed, test.p_value(z))
        )
    return found
