"""Posterior samples of the soil parameters, given the force balances of a rover's climbs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.prior import Prior
from soilml.quantities import SHEAR
from soilml.systems.climbing.climb import ShearParameters, Uncertainty
from soilml.systems.climbing.climb_balances import ForceBalances

#: Random soils among which the search starts; posterior samples returned; iterations in which the
#: noise covariance, which depends on the soil, is updated at the current centre. Two suffice: the
#: covariance changes little over the posterior.
START_SOILS, SAMPLES, ITERATIONS = 2048, 6000, 2
#: A climb is refused if its balance misses every soil of the priors by this many standard
#: deviations.
MAX_MISS = 6.0
#: Climbs are refused as contradictory if the noise would have to be this many times larger.
MAX_NOISE_SCALE = 5.0
#: Standard deviations of the reduced chi-square above which the noise is scaled up.
MISFIT_LIMIT = 2.5
EDGE = 1e-6  # Distance of the corner soils from the edges of the unit cube


@dataclass(frozen=True)
class SoilPosterior:
    """Posterior samples of the soil, and how well the climbs agree with their mean."""

    u: Floats  # (n, p), fractions of the priors
    samples: Floats  # (n, 3): c (Pa), phi (rad), k_x (m)
    samples_as_measured: Floats  # (n, 3), without the shared error of the entry angles
    residual: Floats  # (climbs,) N, pull less the weight's component along the slope, at the mean
    residual_std: Floats  # (climbs,) N
    misfit: float  # reduced chi-square, expected value 1
    noise_scale: float  # factor by which the noise was scaled up to match the misfit


@dataclass(frozen=True)
class SoilSampler:
    """Force balances of the climbs, the fixed parameters, and the priors of the others."""

    balances: ForceBalances
    fixed: Mapping[str, float]
    priors: Mapping[str, Prior]
    noise: Uncertainty

    def soils(self, u: Floats) -> Floats:
        """(c, phi, k_x) (n, 3) at fractions (n, p) of the priors."""
        free = list(self.priors)
        columns = [
            self.priors[name].at(u[:, free.index(name)])
            if name in free
            else np.full(len(u), self.fixed[name])
            for name in SHEAR
        ]
        return np.stack(columns, axis=1)

    def residuals(self, u: Floats) -> Floats:
        """Pull less the weight's component along the slope, N (n, climbs)."""
        return self.balances.residuals(self.soils(u))

    def sample(self, rng: np.random.Generator) -> SoilPosterior:
        """Draw from the posterior.

        The covariance of the residuals depends on the soil. It is evaluated at the best of the
        starting soils first, then at the mean of the samples. If the misfit at that mean exceeds
        what noise explains, the noise is scaled up to match it.

        Raises `InputError` for a climb that no soil explains, `FitError` for climbs that no single
        soil explains.
        """
        free = len(self.priors)
        start = np.vstack([rng.random((START_SOILS, free)), _corners(free)])
        start_residuals = self.residuals(start)
        centre = self.soils(np.full((1, free), 0.5))[0]
        for _ in range(ITERATIONS):
            whitener, std = self.balances.whitener(_shear(centre), self.noise)
            chi_square = ((start_residuals @ whitener.T) ** 2).sum(axis=1)
            best = int(np.argmin(chi_square))
            centre = self.soils(start[best : best + 1])[0]
        self._refuse_unexplained(start_residuals, std)
        noise_scale = 1.0
        for _ in range(ITERATIONS):
            u = self._draw(whitener / noise_scale, rng)
            centre = self.soils(u).mean(axis=0)
            whitener, std = self.balances.whitener(_shear(centre), self.noise)
            misfit = self._misfit(centre, whitener)
            noise_scale = float(np.sqrt(misfit)) if misfit > self._misfit_limit else 1.0
        self._refuse_contradiction(centre, std, noise_scale)
        without_entry_error = replace(self.noise, entry_angle=0.0)
        as_measured, _ = self.balances.whitener(_shear(centre), without_entry_error)
        return SoilPosterior(
            u=u,
            samples=self.soils(u),
            samples_as_measured=self.soils(self._draw(as_measured / noise_scale, rng)),
            residual=self.balances.residuals(centre[None])[0],
            residual_std=std,
            misfit=misfit,
            noise_scale=noise_scale,
        )

    def _draw(self, whitener: Floats, rng: np.random.Generator) -> Floats:
        """Posterior samples (n, p) of the fractions, for Gaussian residuals whitened as given."""
        if not self.priors:
            return np.zeros((SAMPLES, 0))

        def log_density(u: Floats) -> Floats:
            return np.asarray(-0.5 * ((self.residuals(u) @ whitener.T) ** 2).sum(axis=1))

        weighted = importance_sample(log_density, len(self.priors), int(rng.integers(2**31)))
        return weighted.u[rng.choice(len(weighted.u), SAMPLES, p=weighted.weights)]

    @property
    def _degrees_of_freedom(self) -> int:
        return len(self.balances.climbs) - len(self.priors)

    @property
    def _misfit_limit(self) -> float:
        """Reduced chi-square that noise alone rarely exceeds; its variance is 2 / freedom."""
        return 1.0 + MISFIT_LIMIT * float(np.sqrt(2.0 / max(self._degrees_of_freedom, 1)))

    def _misfit(self, centre: Floats, whitener: Floats) -> float:
        residual = whitener @ self.balances.residuals(centre[None])[0]
        return float(residual @ residual) / max(self._degrees_of_freedom, 1)

    def _refuse_unexplained(self, residuals: Floats, std: Floats) -> None:
        """Raise `InputError` for the climb that is farthest from all soils of the priors."""
        miss = np.maximum(residuals.min(axis=0), -residuals.max(axis=0)) / std
        if miss.max() <= MAX_MISS:
            return
        i = int(np.argmax(miss))
        climb, rover = self.balances.climbs[i], self.balances.rover
        required = rover.weight * np.sin(climb.slope)
        too_little = residuals[:, i].max() < 0.0
        nearest = residuals[:, i].max() if too_little else residuals[:, i].min()
        pull = nearest + required
        raise InputError(
            f"run {climb.name}: a slope of {climb.slope:.3g} rad requires {required:.3g} N, but on "
            f"every soil within the ranges the wheels pull "
            f"{'at most' if too_little else 'at least'} {pull:.3g} N at these slips and stresses; "
            "check slope_rad (rad, positive uphill), slip, angle_rad (positive forward) and the "
            "mass, or widen [soil.prior]"
        )

    def _refuse_contradiction(self, centre: Floats, std: Floats, noise_scale: float) -> None:
        """Raise `FitError` if no single soil explains all climbs, naming the largest outlier."""
        if noise_scale <= MAX_NOISE_SCALE:
            return
        residual = self.balances.residuals(centre[None])[0]
        i = int(np.argmax(np.abs(residual) / std))
        raise FitError(
            f"no single soil within the ranges explains these climbs: their force balances miss by "
            f"{noise_scale:.0f} times the noise, run {self.balances.climbs[i].name} by "
            f"{residual[i]:+.3g} N; check its slope_rad, slip and stress, and [noise]"
        )


def _shear(values: Floats) -> ShearParameters:
    return float(values[0]), float(values[1]), float(values[2])


def _corners(p: int) -> Floats:
    """The corners of the unit cube, just inside, (2^p, p)."""
    return np.asarray(list(product((EDGE, 1.0 - EDGE), repeat=p)), dtype=np.float64)
