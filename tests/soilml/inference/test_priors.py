"""Exact priors of single coordinates, against quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad

from soilml.fitting.coordinates import Coordinate
from soilml.inference.priors import (
    UNIFORM_PRECISION,
    WEAK_PRECISION,
    corrections_of_priors,
    log_density_of_size,
)
from soilml.numerics.prior import Prior

SOIL = Coordinate("cohesion", "Pa", Prior(0.0, 1.0))
SIZE = Coordinate("rate.m", "1", Prior(0.0, 1.0), upper=np.inf, of_candidate=True)
EITHER = Coordinate("a.b", "1", Prior(0.0, 1.0), lower=-np.inf, upper=np.inf, of_candidate=True)


@pytest.mark.parametrize(
    ("coordinate", "x", "precision", "step", "push", "held"),
    [
        (SOIL, 0.5, 500.0, 0.0, 0.0, False),
        (SOIL, 0.03, 400.0, -0.1, 0.0, False),
        (SOIL, 0.9, 60.0, 0.3, 0.0, False),
        (SOIL, 0.0, 300.0, 0.0, -40.0, True),
        (SOIL, 1.0, 300.0, 0.0, 40.0, True),
        (SOIL, 0.0, 300.0, 0.0, 40.0, True),
        (SIZE, 1.2, 30.0, 0.0, 0.0, False),
        (SIZE, 0.1, 5.0, 0.2, 0.0, False),
        (SIZE, 0.0, 20.0, 0.0, -10.0, True),
        (EITHER, -0.8, 40.0, 0.1, 0.0, False),
        (EITHER, 2.5, 3.0, -0.2, 0.0, False),
    ],
)
def test_the_correction_is_the_integral_over_that_of_laplace(
    coordinate, x, precision, step, push, held
):
    """Soil has the density one of its prior, a size that of sizes, without their stand-ins."""
    of_size = coordinate.of_candidate
    own = precision - (WEAK_PRECISION if of_size else UNIFORM_PRECISION)
    outward = push * (1.0 if x == coordinate.lower else -1.0) < 0.0
    slope = (push if outward else 0.0) if held else precision * step
    two_sided = coordinate.lower < 0.0

    def integrand(t):
        prior = np.exp(log_density_of_size(np.asarray(x + t), two_sided)) if of_size else 1.0
        return float(prior * np.exp(slope * t - 0.5 * own * t**2))

    low, high = max(coordinate.lower - x, -20.0), min(coordinate.upper - x, 20.0)
    near = [t for t in (-x - 0.01, -x, -x + 0.01, slope / own) if low < t < high]
    exact = quad(integrand, low, high, points=near or None, limit=500)[0]
    laplace = np.sqrt(2.0 * np.pi / precision)
    laplace *= 1.0 if held else np.exp(0.5 * precision * step**2)
    one = (np.asarray([value]) for value in (x, precision, step, push, held))
    found = corrections_of_priors([coordinate], *one)
    assert found == pytest.approx([-2.0 * np.log(exact / laplace)], abs=0.02)
