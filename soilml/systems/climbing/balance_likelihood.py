"""How well a soil explains the balance of all climbs together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior
from soilml.systems.climbing.balance_noise import Shear, spread
from soilml.systems.climbing.climb import Climb, Uncertainty
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.wheel_force_parts import Parts, parts, pull_of_rover, stacked

Floats = NDArray[np.float64]

#: Values of k_x, even in the logarithm, between which forces are straight lines.
KNOTS = 256
#: Share of the weight below which no standard deviation of a balance is believed.
LEAST = 1e-4


@dataclass(frozen=True)
class Balances:
    """The climbs of one rover, with forces worked out over the range of k_x."""

    rover: Rover
    climbs: tuple[Climb, ...]
    log_modulus: Floats  # (KNOTS,)
    wheels: tuple[Parts, Parts]  # front and rear, each part (climbs, KNOTS)

    @classmethod
    def over(cls, rover: Rover, climbs: Sequence[Climb], modulus: Prior) -> Balances:
        """Worked out between the ends of a prior."""
        knots = np.linspace(np.log(modulus.lower) - 1e-6, np.log(modulus.upper) + 1e-6, KNOTS)
        front = stacked([parts(climb.front, rover, np.exp(knots)) for climb in climbs])
        rear = stacked([parts(climb.rear, rover, np.exp(knots)) for climb in climbs])
        return cls(rover, tuple(climbs), knots, (front, rear))

    def off(self, soils: Floats) -> Floats:
        """Pull less weight down the slope (n, climbs), N, at soils (n, 3): c, phi, k_x."""
        cohesion, friction, modulus = soils.T
        place = np.interp(np.log(modulus), self.log_modulus, np.arange(len(self.log_modulus)))
        low = np.minimum(place.astype(int), len(self.log_modulus) - 2)
        front, rear = (wheel.between(low, place - low) for wheel in self.wheels)
        slope = np.asarray([climb.slope for climb in self.climbs])[:, None]
        pull = pull_of_rover(self.rover, slope, (front, rear), cohesion, np.tan(friction))
        return np.asarray(pull - self.rover.weight * np.sin(slope)).T

    def whitener(self, shear: Shear, noise: Uncertainty) -> tuple[Floats, Floats]:
        """(L, std): L @ off has unit noise (climbs, climbs); std of each climb, N, (climbs,)."""
        found = np.asarray([spread(self.rover, c, shear, noise) for c in self.climbs])
        shared = found[:, 1:]
        least = LEAST * self.rover.weight
        covariance = np.diag(found[:, 0] ** 2 + least**2) + shared @ shared.T
        return np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(np.diag(covariance))
