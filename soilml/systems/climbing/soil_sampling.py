"""The soils that explain a rover's climbs, drawn from the range that is searched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError, InputError
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.prior import Prior
from soilml.quantities import SHEAR
from soilml.systems.climbing.balance_likelihood import Balances
from soilml.systems.climbing.balance_noise import Shear
from soilml.systems.climbing.climb import Uncertainty

Floats = NDArray[np.float64]

#: Soils looked at first, draws in the end, and rounds in which the noise is taken anew.
LOOKS, DRAWS, ROUNDS = 2048, 6000, 2
#: Standard deviations by which a climb must miss every soil of the range to be refused.
BEYOND = 6.0
#: Misfit, in standard deviations of the noise, at which climbs contradict each other.
CONTRADICTION = 5.0


@dataclass(frozen=True)
class Found:
    """Draws of the soil, and how the climbs fit their mean."""

    u: Floats  # (n, p), fractions of the ranges
    draws: Floats  # (n, 3): c (Pa), phi (rad), k_x (m)
    as_read: Floats  # (n, 3), had the entry angles no error that all runs share
    off: Floats  # (climbs,) N, pull less weight down the slope at the mean
    off_std: Floats  # (climbs,) N
    misfit: float  # mean square of what noise should make 1, per degree of freedom
    widened: float  # by how much the noise was raised to match the misfit


@dataclass(frozen=True)
class Search:
    """Climbs, the parameters held, and the ranges of the others."""

    balances: Balances
    given: Mapping[str, float]
    ranges: Mapping[str, Prior]
    noise: Uncertainty

    def soils(self, u: Floats) -> Floats:
        """(c, phi, k_x) (n, 3) at fractions (n, p) of the ranges."""
        free = list(self.ranges)
        columns = [
            self.ranges[name].at(u[:, free.index(name)])
            if name in free
            else np.full(len(u), self.given[name])
            for name in SHEAR
        ]
        return np.stack(columns, axis=1)

    def off(self, u: Floats) -> Floats:
        """Pull less weight down the slope (n, climbs), N."""
        return self.balances.off(self.soils(u))

    def found(self, rng: np.random.Generator) -> Found:
        """Draws from the posterior; raises `InputError` or `FitError` where none explains them."""
        p = len(self.ranges)
        u = np.vstack([rng.random((LOOKS, p)), _corners(p)])
        off = self.off(u)
        centre, widened = self.soils(np.full((1, p), 0.5))[0], 1.0
        for _ in range(ROUNDS):
            whitener, std = self.balances.whitener(_shear(centre), self.noise)
            best = int(np.argmin(((off @ whitener.T) ** 2).sum(axis=1)))
            centre = self.soils(u[best : best + 1])[0]
        self._refuse_unexplained(off, std)
        for _ in range(ROUNDS):
            u = self._drawn(whitener / widened, rng)
            centre = self.soils(u).mean(axis=0)
            whitener, std = self.balances.whitener(_shear(centre), self.noise)
            misfit = self._misfit(centre, whitener)
            widened = float(np.sqrt(misfit)) if misfit > self._expected else 1.0
        self._refuse_contradiction(centre, std, widened)
        unshared, _ = self.balances.whitener(_shear(centre), replace(self.noise, entry_angle=0.0))
        return Found(
            u=u,
            draws=self.soils(u),
            as_read=self.soils(self._drawn(unshared / widened, rng)),
            off=self.balances.off(centre[None])[0],
            off_std=std,
            misfit=misfit,
            widened=widened,
        )

    def _drawn(self, whitener: Floats, rng: np.random.Generator) -> Floats:
        """Draws (n, p) of fractions, with all noise Gaussian and as `whitener` has it."""
        if not self.ranges:
            return np.zeros((DRAWS, 0))

        def log_density(u: Floats) -> Floats:
            return np.asarray(-0.5 * ((self.off(u) @ whitener.T) ** 2).sum(axis=1))

        found = importance_sample(log_density, len(self.ranges), int(rng.integers(2**31)))
        return found.u[rng.choice(len(found.u), DRAWS, p=found.weights)]

    @property
    def _freedom(self) -> int:
        return len(self.balances.climbs) - len(self.ranges)

    @property
    def _expected(self) -> float:
        """Misfit that noise alone hardly ever exceeds."""
        return 1.0 + 2.5 * float(np.sqrt(2.0 / max(self._freedom, 1)))

    def _misfit(self, centre: Floats, whitener: Floats) -> float:
        residual = whitener @ self.balances.off(centre[None])[0]
        return float(residual @ residual) / max(self._freedom, 1)

    def _refuse_unexplained(self, off: Floats, std: Floats) -> None:
        """Raise `InputError` for the climb that lies farthest beyond all soils of the ranges."""
        beyond = np.maximum(off.min(axis=0), -off.max(axis=0)) / std
        if beyond.max() <= BEYOND:
            return
        i = int(np.argmax(beyond))
        climb, rover = self.balances.climbs[i], self.balances.rover
        needed = rover.weight * np.sin(climb.slope)
        most = off[:, i].max() < 0.0
        reach = (off[:, i].max() if most else off[:, i].min()) + needed
        raise InputError(
            f"run {climb.name}: a slope of {climb.slope:.3g} rad takes {needed:.3g} N, the wheels "
            f"pull {'at most' if most else 'no less than'} {reach:.3g} N at these slips and "
            "stresses on any soil within the ranges; check slope_rad (rad, positive uphill), slip, "
            "angle_rad (positive forward) and the mass, or widen [soil.prior]"
        )

    def _refuse_contradiction(self, centre: Floats, std: Floats, widened: float) -> None:
        """Raise `FitError` where no one soil explains all climbs, with the one farthest off."""
        if widened <= CONTRADICTION:
            return
        off = self.balances.off(centre[None])[0]
        i = int(np.argmax(np.abs(off) / std))
        raise FitError(
            f"no one soil within the ranges explains these climbs: they miss their balance by "
            f"{widened:.0f} times what the noise allows, run {self.balances.climbs[i].name} by "
            f"{off[i]:+.3g} N; check its slope_rad, slip and stress, and [noise]"
        )


def _shear(values: Floats) -> Shear:
    return float(values[0]), float(values[1]), float(values[2])


def _corners(p: int) -> Floats:
    """The corners of the unit cube, a hair inside, (2^p, p)."""
    return np.asarray(list(product((1e-6, 1.0 - 1e-6), repeat=p)), dtype=np.float64)
