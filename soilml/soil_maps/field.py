"""The soil along a drive as a field over position, and what a rover does on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.soil_maps.local_soils import LocalSoils, lower_root, soil_values
from soilml.traction.draws import SoilDraws
from soilml.traction.soil_draws import mixed_prior_draws
from soilml.traction.vehicle import DrivenVehicle, on_slopes

#: Shares of the variance of a patch that is local, correlation lengths of this part over the
#: largest distance between stretches, shares of the rest that all patches have in common, and
#: factors on the errors of the stretches.
LOCAL, LENGTHS = (0.1, 0.35, 0.7), (0.04, 0.1, 0.25, 0.6)
DRIVE, EXCESS = (0.15, 0.6), (1.0, 2.0, 4.0)
#: Correlation, between patches, of the error that all stretches of one share: that of sensors is
#: the same everywhere, that of the model changes with the soil.
ACROSS = 0.5
LEAST_WEIGHT = 0.02  # Weight of a setting over the largest below which it is left out
TINY = 1e-9  # Added to variances
BLOCK = 2000  # Places that are predicted at a time


@dataclass(frozen=True)
class FieldSetting:
    """Covariance of the scores, whose variance is 1 everywhere, as that of the prior."""

    drive: float  # Share that the whole drive has in common
    patch: float  # Share that a patch has in common
    local: float  # Share that varies within it
    length: float  # m
    excess: float  # Factor on the errors of the stretches

    def correlation(self, distance: Floats, same: Floats) -> Floats:
        """Of places (n, m) at these distances, m, on the same patch or not."""
        root = np.sqrt(3.0) * distance / self.length
        within = self.patch + self.local * (1.0 + root) * np.exp(-root)
        return np.asarray(self.drive + same * within)


@dataclass(frozen=True)
class SoilField:
    r"""Normal scores z of the soil at any place, given those of stretches.

    .. math::
        \operatorname{cov}[z_j(x), z_j(x')] = \alpha + [\text{same patch}]\,
        \left(\beta + \gamma (1 + \rho) e^{-\rho}\right), \quad
        \rho = \sqrt3\, |x - x'| / l, \quad \alpha + \beta + \gamma = 1

    alike for all parameters, which are independent before the readings. Readings see z + g + e: g
    is an error that the whole drive shares, e that of each stretch. Answers are averaged over
    shares, lengths and sizes of e, each weighted by its marginal likelihood.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.23 to
    2.26, 2.30 and 4.17; Diggle and Ribeiro, Model-based Geostatistics, 2007, section 7.2 (averaging
    over parameters of the covariance).
    """

    soils: LocalSoils

    @cached_property
    def settings(self) -> list[FieldSetting]:
        """All that are averaged."""
        extent = max(float(self._distance.max()), TINY)
        shapes = [(0.0, 1.0), *((g, share * extent) for g in LOCAL for share in LENGTHS)]
        return [
            FieldSetting((1.0 - g) * a, (1.0 - g) * (1.0 - a), g, length, excess)
            for a in DRIVE
            for g, length in shapes
            for excess in EXCESS
        ]

    @cached_property
    def weights(self) -> Floats:
        """Probability of each setting, given the stretches."""
        log = np.asarray([self._likelihood(setting) for setting in self.settings])
        weights = np.exp(log - log.max())
        weights[weights < LEAST_WEIGHT] = 0.0
        return np.asarray(weights / weights.sum())

    @property
    def length(self) -> float:
        """Mean length over which the soil varies within a patch, m; NaN where it does not."""
        own = [(w, s) for w, s in zip(self.weights, self.settings, strict=True) if s.local]
        total = sum(w for w, _ in own)
        return float(sum(w * s.length for w, s in own) / total) if total > 0.5 else float("nan")

    @property
    def local(self) -> float:
        """Mean share of the variance of a patch that is local."""
        shares = [s.local for s in self.settings]
        return float(self.weights @ np.asarray(shares))

    def at(self, place: Floats) -> tuple[Floats, Floats]:
        """Means (n, p) and covariances (n, p, p) of the scores at places (n, 2).

        The patch of a place is that of the nearest stretch, or the next one, in the ratio of their
        squared distances: where a change lies between them is not known.
        """
        n, p = len(place), self.soils.score.shape[1]
        mean, square = np.zeros((n, p)), np.zeros((n, p, p))
        for setting, weight in zip(self.settings, self.weights, strict=True):
            if weight == 0.0:
                continue
            solved = self._solved(setting)
            for start in range(0, n, BLOCK):
                part = slice(start, start + BLOCK)
                for patch, share in self._patches(place[part]):
                    m, c = self._given(setting, solved, place[part], patch)
                    own = weight * share
                    mean[part] += own[:, None] * m
                    square[part] += own[:, None, None] * (c + m[:, :, None] * m[:, None, :])
        return mean, square - mean[:, :, None] * mean[:, None, :]

    def _patches(self, place: Floats) -> list[tuple[Integers, Floats]]:
        """The two patches that places (n,) may be of, and the probability of each."""
        names = np.unique(self.soils.patch)
        away = _distances(place, self.soils.place)
        nearest = np.stack([away[:, self.soils.patch == i].min(axis=1) for i in names], axis=1)
        if len(names) == 1:
            return [(np.full(len(place), names[0]), np.ones(len(place)))]
        order, row = np.argsort(nearest, axis=1), np.arange(len(place))
        first, second = nearest[row, order[:, 0]], nearest[row, order[:, 1]]
        share = second**2 / np.maximum(first**2 + second**2, TINY)
        return [(names[order[:, 0]], share), (names[order[:, 1]], 1.0 - share)]

    @cached_property
    def _distance(self) -> Floats:
        return _distances(self.soils.place, self.soils.place)

    @cached_property
    def _same(self) -> Floats:
        return np.asarray(self.soils.patch[:, None] == self.soils.patch, dtype=np.float64)

    def _covariance(self, setting: FieldSetting) -> Floats:
        """Of what the stretches show, (b p, b p)."""
        b, p = self.soils.score.shape
        shared = ACROSS + (1.0 - ACROSS) * self._same
        whole = shared[:, None, :, None] * self.soils.common[:, None]
        between = setting.correlation(self._distance, self._same)
        for j in range(p):
            whole[:, j, :, j] += between
        each = np.arange(b)
        whole[each, :, each, :] += setting.excess * self.soils.error + TINY * np.eye(p)
        return whole.reshape(b * p, b * p)

    def _likelihood(self, setting: FieldSetting) -> float:
        root = np.linalg.cholesky(self._covariance(setting))
        white = np.linalg.solve(root, self.soils.score.ravel())
        return float(-0.5 * white @ white - np.log(np.diag(root)).sum())

    def _solved(self, setting: FieldSetting) -> tuple[Floats, Floats]:
        """Inverse covariance (b, p, b, p), and its product with the scores (b, p)."""
        b, p = self.soils.score.shape
        inverse = np.asarray(np.linalg.inv(self._covariance(setting)), dtype=np.float64)
        weights = inverse @ self.soils.score.ravel()
        return inverse.reshape(b, p, b, p), weights.reshape(b, p)

    def _given(
        self,
        setting: FieldSetting,
        solved: tuple[Floats, Floats],
        place: Floats,
        patch: Integers,
    ) -> tuple[Floats, Floats]:
        """Means and covariances for one setting."""
        inverse, weights = solved
        p = weights.shape[1]
        same = np.asarray(patch[:, None] == self.soils.patch, dtype=np.float64)
        across = setting.correlation(_distances(place, self.soils.place), same)
        covariance = np.tile(np.eye(p), (len(place), 1, 1))
        for i in range(p):
            for j in range(p):
                covariance[:, i, j] -= ((across @ inverse[:, i, :, j]) * across).sum(axis=1)
        return across @ weights, covariance


def _distances(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.hypot(*(a[:, None, k] - b[None, :, k] for k in range(2))))


DRAWS = 1200  # Soils that stand for those of all places together
SLIP_LIMIT = 0.6
SLIPS = np.linspace(0.05, 1.0, 12)  # Shares of the limit
WEIGHED = 500  # Places whose weights are computed at a time
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

    Of several explanations, each draw has the effects of one, with its probability.

    mean, covariance: Of the scores, (n, p) and (n, p, p).
    slope: Slopes (m,), rad, from 0 to 60 degrees.

    Raises `InputError` as `on_slopes` does.

    References: Veach and Guibas, SIGGRAPH 1995 (weights by the mixture of all densities).
    """
    n, p = mean.shape
    rng = np.random.default_rng(0)
    root = lower_root(covariance)
    own = np.resize(rng.permutation(n), DRAWS)
    draws = mean[own] + np.einsum("kij,kj->ki", root[own], rng.standard_normal((DRAWS, p)))
    names, values = [f.path for f in soils.free], soil_values(soils.free, draws)
    if case.explanations:
        case, mixed = mixed_prior_draws(case, DRAWS)
        effects = [i for i, path in enumerate(mixed.names) if "." in path]
        names += [mixed.names[i] for i in effects]
        values = np.concatenate([values, mixed.values[:, effects]], axis=1)
    drawn, slips = SoilDraws(tuple(names), values), SLIP_LIMIT * SLIPS
    found = on_slopes(DrivenVehicle.of_rover(case), drawn, slope, slips)
    climbs = found["margin"] >= 0.0
    outcomes = [climbs * 1.0, *(np.where(climbs, np.nan_to_num(found[name]), 0.0)
                                for name in ("slip", "energy"))]  # fmt: skip
    parts = [slice(i, i + WEIGHED) for i in range(0, n, WEIGHED)]
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
