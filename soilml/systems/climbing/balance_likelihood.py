"""Residuals of the force balance of all climbs, and their joint covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior
from soilml.systems.climbing.climb import Climb, Rover, Uncertainty
from soilml.systems.climbing.climb_balances import ShearParameters, balance_std
from soilml.systems.climbing.wheel_force_components import (
    ForceComponents,
    force_components,
    pull_of_rover,
    stack_components,
)

Floats = NDArray[np.float64]

#: Values of k_x, evenly spaced in the logarithm, between which forces are interpolated linearly.
KNOTS = 256
#: Extension of the table of ln k_x beyond both ends of the prior, against rounding.
MARGIN = 1e-6
#: Lower limit of the standard deviation of a balance, as a fraction of the weight.
MIN_STD_FRACTION = 1e-4


@dataclass(frozen=True)
class ForceBalances:
    """The climbs of one rover, with wheel forces tabulated over the range of k_x."""

    rover: Rover
    climbs: tuple[Climb, ...]
    log_modulus: Floats  # (KNOTS,)
    wheels: tuple[ForceComponents, ForceComponents]  # front and rear, each (climbs, KNOTS)

    @classmethod
    def tabulate(cls, rover: Rover, climbs: Sequence[Climb], modulus: Prior) -> ForceBalances:
        """Tabulate the wheel forces between the ends of the prior of k_x (m)."""
        knots = np.linspace(np.log(modulus.lower) - MARGIN, np.log(modulus.upper) + MARGIN, KNOTS)
        front = stack_components([force_components(c.front, rover, np.exp(knots)) for c in climbs])
        rear = stack_components([force_components(c.rear, rover, np.exp(knots)) for c in climbs])
        return cls(rover, tuple(climbs), knots, (front, rear))

    def residuals(self, soils: Floats) -> Floats:
        """Pull less the weight's component along the slope, N (n, climbs).

        `soils` (n, 3) are cohesion (Pa), friction angle (rad) and shear modulus (m).
        """
        cohesion, friction, modulus = soils.T
        position = np.interp(np.log(modulus), self.log_modulus, np.arange(len(self.log_modulus)))
        knot = np.minimum(position.astype(int), len(self.log_modulus) - 2)
        front, rear = (wheel.interpolated(knot, position - knot) for wheel in self.wheels)
        slope = np.asarray([climb.slope for climb in self.climbs])[:, None]
        pull = pull_of_rover(self.rover, slope, (front, rear), cohesion, np.tan(friction))
        return np.asarray(pull - self.rover.weight * np.sin(slope)).T

    def whitener(self, shear: ShearParameters, noise: Uncertainty) -> tuple[Floats, Floats]:
        """Whitening matrix and standard deviations of the residuals at one soil.

        Returns (L, std): L @ residuals has unit covariance, L (climbs, climbs); std (climbs,), N.
        """
        stds = np.asarray([balance_std(self.rover, c, shear, noise) for c in self.climbs])
        independent, shared = stds[:, 0], stds[:, 1:]
        lower_limit = MIN_STD_FRACTION * self.rover.weight
        covariance = np.diag(independent**2 + lower_limit**2) + shared @ shared.T
        return np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(np.diag(covariance))
