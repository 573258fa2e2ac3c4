"""A density whose model is replaced by polynomials, in a box of the unit cube."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.resampling import systematic_resampling
from soilml.numerics.sampling.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.sampling.polynomial_surface import PolynomialSurface, Scaling

Floats = NDArray[np.float64]

#: A region ends so many standard deviations from its middle, unless the density goes on beyond.
REACH = 4.5
#: Farthest from the middle that polynomials are used, in standard deviations: the corners of a box
#: of many dimensions are far beyond the points that they were fitted to.
FARTHEST = 8.0
#: Dimensions from which on the first samples are drawn about the middle.
MANY_DIMENSIONS = 5
#: Most predictions that are held at once: few enough to stay in a processor's cache.
BLOCK = 100_000
#: Trials of the error of the log density.
TRIALS = 256


class ModelDensity(Protocol):
    """A density over the unit cube that depends on a model's predictions."""

    def predict(self, u: Floats, /) -> Floats:
        """Predictions (n, k) at points (n, p); NaN where there are none."""
        ...

    def of_predictions(self, y: Floats, /) -> Floats:
        """Logarithm (n,) of the density, up to a constant, where the model predicts y (n, k)."""
        ...


@dataclass(frozen=True)
class Region:
    """A box in the unit cube, along the axes of a scaling; it may stand out of the cube."""

    scaling: Scaling
    half_width: float  # in standard deviations

    @staticmethod
    def cube(p: int) -> Region:
        """The whole cube: a uniform distribution ends at the root of three standard deviations."""
        return Region(Scaling(np.full(p, 0.5), np.eye(p) / sqrt(12.0)), sqrt(3.0))

    @staticmethod
    def of(samples: ImportanceSample, reach: float = REACH) -> Region:
        """The box about the middle of samples."""
        return Region(Scaling.of(samples.u, samples.weights), reach)

    def points(self, fractions: Floats) -> Floats:
        """Points (n, p) of the cube's space at fractions (n, p) of the box."""
        return self.scaling.back((2.0 * fractions - 1.0) * self.half_width)

    def distance(self, u: Floats) -> Floats:
        """Distance (n,) of points (n, p) from the middle, in standard deviations."""
        return np.asarray(np.sqrt((self.scaling(u) ** 2).sum(axis=1)))

    def share_at_faces(self, samples: ImportanceSample) -> float:
        """Probability of the outermost twentieth of the box."""
        outmost = np.abs(self.scaling(samples.u)).max(axis=1) > 0.95 * self.half_width
        return float(samples.weights[outmost].sum())

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume of the box."""
        p = len(self.scaling.centre)
        return float(p * np.log(2.0 * self.half_width) + np.linalg.slogdet(self.scaling.root)[1])


@dataclass(frozen=True)
class SurrogateDensity:
    """A power of a density in a region, with polynomials in place of its model."""

    density: ModelDensity
    region: Region
    surface: PolynomialSurface
    power: float = 1.0

    def __call__(self, u: Floats) -> Floats:
        """Its logarithm (n,) at points (n, p)."""
        size = max(BLOCK // self.surface.coefficients.shape[1], 1)
        logs = np.empty(len(u))
        for start in range(0, len(u), size):
            y = self.surface(u[start : start + size])
            logs[start : start + size] = self.density.of_predictions(y)
        return self.power * logs

    def sample(self, least_effective_size: float) -> ImportanceSample:
        """Weighted samples of it; see `importance_sample`."""

        def log_density(fractions: Floats) -> Floats:
            u = self.region.points(fractions)
            inside = np.all((u > 0.0) & (u < 1.0), axis=1)
            inside &= self.region.distance(u) < FARTHEST
            logs = np.full(len(u), -np.inf)
            logs[inside] = self(u[inside])
            return logs

        p = len(self.region.scaling.centre)
        many = p >= MANY_DIMENSIONS
        found = importance_sample(
            log_density,
            p,
            least_effective_size=least_effective_size,
            middle_std=0.5 / self.region.half_width if many else None,
        )
        kept = found.weights > 0.0
        return ImportanceSample(
            self.region.points(found.u[kept]),
            found.weights[kept],
            found.evidence + self.region.log_volume,
        )

    def error_under(
        self, samples: ImportanceSample, errors: Floats, rng: np.random.Generator
    ) -> float:
        """Standard deviation of the error of its logarithm under samples of it.

        The predictions err by any of `errors` (n, k), chosen at random.
        """
        chosen = systematic_resampling(samples.weights, TRIALS, rng.random())
        y = self.surface(samples.u[chosen])
        wrong = y + errors[rng.integers(len(errors), size=TRIALS)]
        change = self.density.of_predictions(wrong) - self.density.of_predictions(y)
        return float(self.power * np.std(change))
