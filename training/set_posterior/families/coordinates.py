"""One unknown of the soil as a coordinate between -1 and 1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.numerics.prior import Prior

#: A range whose lower end is below this share of its upper end is treated as one from zero, where
#: the logarithm is unbounded: its coordinate is the logarithm of the value plus an offset.
ZERO_SHARE = 0.1
#: Ratio of both ends of such a range after the offset was added: enough curvature for cohesion.
OFFSET_RATIO = 4.0
#: A range with a larger ratio of its ends than this has a logarithmic coordinate: in a narrower one
#: the logarithm is nearly linear.
LOGARITHMIC_RATIO = 1.5
#: Nearly known axes have a normal prior that is truncated at this many standard deviations.
NORMAL_TRUNCATION = 2.5


@dataclass(frozen=True)
class PriorAxis:
    r"""A parameter's value along its coordinate x, and the density of its prior there.

    .. math:: \theta = \alpha + \beta e^{\gamma x} + \delta x, \qquad \log p(x) = \lambda x + const

    Torque is nearly linear in the logarithms of shear modulus and cohesion, so that a polynomial of
    low degree in these coordinates approximates it closely.
    """

    name: str  # the parameter
    #: alpha, beta, gamma and delta of the value
    shift: float = 0.0
    factor: float = 0.0
    rate: float = 0.0
    slope: float = 0.0
    tilt: float = 0.0  # lambda of the prior, nil where the prior is uniform in x

    @staticmethod
    def of(name: str, prior: Prior) -> PriorAxis:
        """The coordinate for a prior, uniform in the value or in its logarithm."""
        if prior.normal_std is not None:
            raise InputError(
                f"the prior of {name} is normal; a set posterior needs a range, [lower, upper]"
            )
        lower, upper = prior.lower, prior.upper
        if prior.log or (
            lower > 0.0 and upper / lower > LOGARITHMIC_RATIO and lower > ZERO_SHARE * upper
        ):
            rate = 0.5 * math.log(upper / lower)
            tilt = 0.0 if prior.log else rate
            return PriorAxis(name, factor=math.sqrt(lower * upper), rate=rate, tilt=tilt)
        if 0.0 <= lower <= ZERO_SHARE * upper:
            rate, size = 0.5 * math.log(OFFSET_RATIO), (upper - lower) / (OFFSET_RATIO - 1.0)
            factor = size * math.sqrt(OFFSET_RATIO)
            return PriorAxis(name, shift=lower - size, factor=factor, rate=rate, tilt=rate)
        return PriorAxis(name, shift=0.5 * (lower + upper), slope=0.5 * (upper - lower))

    def value(self, x: Floats) -> Floats:
        """The parameter at coordinates x, of any shape."""
        return np.asarray(self.shift + self.factor * np.exp(self.rate * x) + self.slope * x)

    def quantile(self, u: Floats) -> Floats:
        """Quantiles of the prior at probabilities u: coordinates, of the shape of u."""
        if self.tilt == 0.0:
            return np.asarray(2.0 * u - 1.0)
        low, high = math.exp(-self.tilt), math.exp(self.tilt)
        return np.asarray(np.log(low + (high - low) * u) / self.tilt)

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of the range."""
        low, high = self.value(np.asarray([-1.0, 1.0]))
        return float(low), float(high)


def prior_points(axes: Sequence[PriorAxis], free: int, count: int, seed: int) -> Floats:
    """Coordinates (count, p): quantiles of the prior, truncated normal where nearly known."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    u = qmc.Sobol(len(axes), rng=seed).random(1 << (count - 1).bit_length())[:count]
    columns = [axis.quantile(u[:, i]) for i, axis in enumerate(axes[:free])]
    normal = ndtri(np.clip(u[:, free:], 1e-9, 1.0 - 1e-9))
    truncated = np.clip(normal, -NORMAL_TRUNCATION, NORMAL_TRUNCATION) / NORMAL_TRUNCATION
    return np.concatenate([np.stack(columns, axis=1), truncated], axis=1)
