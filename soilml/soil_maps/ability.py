"""What a rover does at each place of a map: probability of climbing, needed slip, energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.soil_maps.local_soils import LocalSoils, soil_values
from soilml.traction.draws import SoilDraws
from soilml.traction.rover_performance import on_slopes

DRAWS = 1200  # Soils that stand for those of all places together
SLIP_LIMIT = 0.6
SLIPS = np.linspace(0.05, 1.0, 12)  # Shares of the limit
BLOCK = 500  # Places whose weights are computed at a time
LEAST_CLIMBED = 0.05  # Probability of climbing below which there is no mean slip


@dataclass(frozen=True)
class MapAbility:
    """A rover straight up m slopes at n places, each (n, m)."""

    slope: Floats  # (m,), rad
    climbed: Floats  # Probability
    slip: Floats  # Mean of the needed slip where it climbs; NaN where it hardly does
    energy: Floats  # J/m, likewise


def map_ability(
    case: Case, soils: LocalSoils, mean: Floats, covariance: Floats, slope: Floats
) -> MapAbility:
    r"""The rover of a case on the soils of n places, normal in scores.

    The same draws z serve all places, each with its own weights:

    .. math:: w_k(x) \propto \frac{p_x(z_k)}{q(z_k)}, \quad q = \frac1n \sum_x p_x

    mean, covariance: Of the scores, (n, p) and (n, p, p).
    slope: Slopes (m,), rad, from 0 to 60 degrees.

    Raises `InputError` as `on_slopes` does.

    References: Veach and Guibas, SIGGRAPH 1995 (weights by the mixture of all densities).
    """
    n, p = mean.shape
    rng = np.random.default_rng(0)
    root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    own = np.resize(rng.permutation(n), DRAWS)
    draws = mean[own] + np.einsum("kij,kj->ki", root[own], rng.standard_normal((DRAWS, p)))
    names = tuple(f.path for f in soils.free)
    _, found = on_slopes(
        case, SoilDraws(names, soil_values(soils.free, draws)), slope, SLIP_LIMIT * SLIPS
    )
    climbs = found["margin"] >= 0.0
    outcomes = [climbs * 1.0, *(np.where(climbs, np.nan_to_num(found[name]), 0.0)
                                for name in ("slip", "energy"))]  # fmt: skip
    parts = [slice(i, i + BLOCK) for i in range(0, n, BLOCK)]
    proposal = np.full(DRAWS, -np.inf)
    for part in parts:
        own_log = _log_density(draws, mean[part], root[part])
        proposal = np.logaddexp(proposal, np.logaddexp.reduce(own_log, axis=0))
    climbed, slip, energy = (np.empty((n, len(slope))) for _ in range(3))
    for part in parts:
        log = _log_density(draws, mean[part], root[part]) - proposal
        weights = np.exp(log - log.max(axis=1, keepdims=True))
        weights /= weights.sum(axis=1, keepdims=True)
        for values, outcome in zip((climbed, slip, energy), outcomes, strict=True):
            values[part] = weights @ outcome
    share = np.where(climbed >= LEAST_CLIMBED, climbed, np.nan)
    return MapAbility(slope, climbed, slip / share, energy / share)


def _log_density(draws: Floats, mean: Floats, root: Floats) -> Floats:
    """Logarithms (n, k) of normal densities, but for a constant, at draws (k, p)."""
    inverse = np.linalg.inv(root)
    white = np.einsum("nij,nkj->nki", inverse, draws - mean[:, None])
    volume = np.log(np.diagonal(inverse, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(volume[:, None] - 0.5 * (white**2).sum(axis=2))
