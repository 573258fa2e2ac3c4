"""A density over the unit cube, in logarithms of the variables whose values span a factor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.importance_sampling import ImportanceSample
from soilml.numerics.surrogate_density import ModelDensity


@dataclass(frozen=True)
class LogarithmicDensity:
    r"""A density over u in fractions v of the logarithm of some variables.

    A variable that is uniform between two positive bounds of ratio R has

    .. math:: u = \frac{R^v - 1}{R - 1}, \qquad \frac{du}{dv} = \frac{R^v \ln R}{R - 1}

    The logarithm of the rate stands behind the predictions as one more, so that it is a factor of
    the density: it is linear in v, and polynomials describe it exactly. Powers of a variable, such
    as a pressure that a modulus and an exponent make together, are closer to polynomials in v, and
    a density along which they are constant is less bent.

    Attributes
    ----------
    density
        The density over u (n, p).
    ratio
        R (p,); one for a variable that stays.
    """

    density: ModelDensity
    ratio: Floats

    def linear(self, v: Floats) -> Floats:
        """u (n, p) of v (n, p)."""
        some, ratio = self.ratio != 1.0, np.where(self.ratio != 1.0, self.ratio, 2.0)
        return np.where(some, (ratio**v - 1.0) / (ratio - 1.0), v)

    def logarithmic(self, u: Floats) -> Floats:
        """v (n, p) of u (n, p)."""
        some, ratio = self.ratio != 1.0, np.where(self.ratio != 1.0, self.ratio, 2.0)
        return np.where(some, np.log1p(u * (ratio - 1.0)) / np.log(ratio), u)

    def log_rate(self, v: Floats) -> Floats:
        """Logarithm (n,) of the product of the rates du/dv."""
        own = self.ratio[self.ratio != 1.0]
        each = v[:, self.ratio != 1.0] * np.log(own) + np.log(np.log(own) / (own - 1.0))
        return np.asarray(each.sum(axis=1))

    def predict(self, v: Floats) -> Floats:
        """Predictions (n, k + 1) at points (n, p), the logarithm of the rates the last."""
        return np.column_stack([self.density.predict(self.linear(v)), self.log_rate(v)])

    def of_predictions(self, y: Floats) -> Floats:
        """Logarithm (n,) of the density over v where the model predicts y (n, k + 1)."""
        return np.asarray(self.density.of_predictions(y[:, :-1]) + y[:, -1])

    def __call__(self, v: Floats) -> Floats:
        """Logarithm (n,) of the density over v (n, p)."""
        return self.of_predictions(self.predict(v))

    def back(self, sample: ImportanceSample) -> ImportanceSample:
        """Samples of u from samples of v."""
        return replace(sample, u=self.linear(sample.u))

    def forth(self, sample: ImportanceSample) -> ImportanceSample:
        """Samples of v from samples of u."""
        return replace(sample, u=self.logarithmic(sample.u))

    def around(self, x: Floats, root: Floats) -> tuple[Floats, Floats]:
        """Middle (p,) and root (p, p) of a covariance over v from those over u, linearised."""
        v = self.logarithmic(x)
        own = np.where(self.ratio != 1.0, self.ratio, np.e)
        rate = np.where(self.ratio != 1.0, own**v * np.log(own) / (own - 1.0), 1.0)
        return v, root / rate[:, None]
