"""Bekker's pressure-sinkage law from plate tests, with the scatter from test to test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.identification.bevameter.estimate import (
    SpreadEstimate,
    distinct_levels,
    spread_estimate,
)
from soilml.identification.bevameter.plate_tests import PlateTest
from soilml.identification.bevameter.relative_line import relative_line
from soilml.identification.bevameter.scatter import Scatter, pooled_scatter
from soilml.parameters import declared
from soilml.physics.soils import Soil

Floats = NDArray[np.float64]

#: Usual standard deviations of repeated plate tests in a carefully prepared bed: of the logarithm
#: of the pressure at one depth, and of the exponent. Loose beds scatter more, and their repeats
#: show it.
USUAL_SCATTER = np.asarray([0.15, 0.1])
#: Ratio of the largest to the smallest plate below which kc is not estimated: the difference in
#: pressure that it could make is then below the scatter of repeats.
LEAST_SIZE_RATIO = 1.1
#: Fraction of the largest depth below which a curve is not used for its bend: there an error of
#: the zero is a large part of the sinkage.
SHALLOW = 0.1


@dataclass(frozen=True)
class PlateCurve:
    """The law fitted to one test: logarithm of the pressure (Pa) at the reference depth, exponent.

    `halves` are the exponents of the shallower and of the deeper half of the curve, NaN where there
    are too few points; `misfit` is the root mean square of relative residuals.
    """

    log_pressure: float
    exponent: float
    halves: tuple[float, float]
    misfit: float


@dataclass(frozen=True)
class PressureSinkageFit:
    r"""Bekker's law fitted to N tests: :math:`p(z_0, b) = A + B / b` and the exponent n.

    Attributes
    ----------
    tests, curves
        The tests, and the law fitted to each.
    depth
        Reference depth z_0 (m), where pressure and exponent are least correlated.
    sizes
        Distinct sizes b of the plates (m).
    pressure
        A (Pa) and B (Pa m) at the reference depth, (2,); B is 0 where there is one size.
    exponent
        n.
    mean_draws, place_draws
        Draws (draws, 3) of A, B and n: of the mean, and of another place of the soil.
    """

    tests: tuple[PlateTest, ...]
    curves: tuple[PlateCurve, ...]
    depth: float
    sizes: tuple[float, ...]
    pressure: Floats
    exponent: float
    mean_draws: Floats
    place_draws: Floats

    @property
    def several_sizes(self) -> bool:
        """Whether kc and kphi are estimated apart."""
        return _several(self.sizes)

    @property
    def moduli(self) -> tuple[float, float]:
        """Estimates of kc and kphi; kc is 0 where there is one size."""
        scale = self.depth**-self.exponent
        return float(self.pressure[1] * scale), float(self.pressure[0] * scale)

    def modulus(self, width: float) -> SpreadEstimate:
        """kc / b + kphi for a width b (m)."""
        kc, kphi = self.moduli
        mean, place = (_modulus(d, self.depth, width) for d in (self.mean_draws, self.place_draws))
        return spread_estimate(kc / width + kphi, mean, place, "N/m^(n+2)")

    def pressure_at_depth(self, size: float) -> SpreadEstimate:
        """Pressure at the reference depth under a plate of a size (m)."""
        mean, place = (d[:, 0] + d[:, 1] / size for d in (self.mean_draws, self.place_draws))
        value = float(self.pressure @ [1.0, 1.0 / size])
        return spread_estimate(value, mean, place, "Pa")

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine: n, and kc with kphi, or k for the one width tested."""
        found = {"n": spread_estimate(self.exponent, *self._draws(2), "1")}
        if not self.several_sizes:
            return found | {"k": self.modulus(self.sizes[0])}
        kc, kphi = self.moduli
        found["kc"] = spread_estimate(kc, *self._draws(1, scaled=True), "N/m^(n+1)")
        found["kphi"] = spread_estimate(kphi, *self._draws(0, scaled=True), "N/m^(n+2)")
        return found

    def _draws(self, column: int, *, scaled: bool = False) -> tuple[Floats, Floats]:
        mean, place = (
            d[:, column] * (self.depth ** -d[:, 2] if scaled else 1.0)
            for d in (self.mean_draws, self.place_draws)
        )
        return mean, place


def fit_pressure_sinkage(tests: Sequence[PlateTest]) -> PressureSinkageFit:
    r"""Fit :math:`p = (k_c / b + k_\varphi) z^n` to plate tests of one or several sizes.

    Each test is fitted on its own by Wong's least squares of the logarithm with weights p^2, at a
    common reference depth z_0; the pressures there are then a straight line in 1 / b. The unit is
    the test: how the results of the tests scatter about that line, and not the number of samples,
    gives the uncertainty. It contains the bend of the curves in the logarithm, as an exponent
    that is not the same at all depths.

    References
    ----------
    Bekker, Introduction to Terrain-Vehicle Systems, 1969. Wong, J. Terramechanics 17(1), 1980,
    weighted least squares of pressure-sinkage data.
    """
    depth = _reference_depth(tests)
    curves = tuple(_fit_curve(test, depth) for test in tests)
    size = np.asarray([test.size for test in tests])
    pressure = np.exp([curve.log_pressure for curve in curves])
    exponents = np.asarray([curve.exponent for curve in curves])
    sizes = distinct_levels(size)
    columns = np.stack([np.ones(size.size), 1.0 / size], axis=1)
    if not _several(sizes):
        columns = columns[:, :1]
    line, hat, fitted = relative_line(columns, pressure)
    exponent = float(exponents.mean())
    residual = np.stack([np.log(pressure / fitted), exponents - exponent], axis=1)
    scatter = pooled_scatter(residual, USUAL_SCATTER, columns.shape[1])
    mean, place = _draws(line, hat, exponent, scatter, _exponent_span(curves, exponent))
    full = np.append(line, np.zeros(2 - line.size))
    return PressureSinkageFit(tuple(tests), curves, depth, sizes, full, exponent, mean, place)


def _several(sizes: tuple[float, ...]) -> bool:
    return sizes[-1] > LEAST_SIZE_RATIO * sizes[0]


def _reference_depth(tests: Sequence[PlateTest]) -> float:
    """Mean of log depth with the weights of the fit, each test with the same weight in all."""
    means = [np.average(np.log(t.sinkage), weights=t.pressure**2) for t in tests]
    return float(np.exp(np.mean(means)))


def _fit_curve(test: PlateTest, depth: float) -> PlateCurve:
    x, y = np.log(test.sinkage / depth), np.log(test.pressure)
    exponent, level = _slope(x, y, test.pressure)
    residual = test.pressure * (y - level - exponent * x)
    misfit = float(np.sqrt(np.sum(residual**2) / np.sum(test.pressure**2)))
    low = max(float(test.sinkage[0]), SHALLOW * float(test.sinkage[-1]))
    middle = np.log(np.sqrt(low * test.sinkage[-1]) / depth)
    shallow = (x <= middle) & (test.sinkage >= low)
    deep = x >= middle
    halves = float("nan"), float("nan")
    if shallow.sum() >= 2 and deep.sum() >= 2:
        first, second = (_slope(x[h], y[h], np.ones(h.sum()))[0] for h in (shallow, deep))
        halves = first, second
    return PlateCurve(level, exponent, halves, misfit)


def _slope(x: Floats, y: Floats, weight: Floats) -> tuple[float, float]:
    """Slope and intercept of a weighted straight line."""
    slope, level = np.polyfit(x, y, 1, w=weight)
    return float(slope), float(level)


def _exponent_span(curves: Sequence[PlateCurve], exponent: float) -> tuple[float, float]:
    """Least and largest of the exponent and the mean exponents of the halves of the curves."""
    halves = np.asarray([c.halves for c in curves if np.isfinite(c.halves).all()])
    known = [exponent, *(halves.mean(axis=0) if halves.size else ())]
    return float(min(known)), float(max(known))


def _draws(
    line: Floats, hat: Floats, exponent: float, scatter: Scatter, span: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Draws (draws, 3) of A, B and n: of the mean, and at another place."""
    p, tests = hat.shape
    s = scatter.covariance
    covariance = np.zeros((p + 1, p + 1))
    covariance[:p, :p] = hat @ hat.T * s[0, 0]
    covariance[:p, p] = covariance[p, :p] = hat.sum(axis=1) / tests * s[0, 1]
    covariance[p, p] = s[1, 1] / tests
    error, deviation = scatter.draws(covariance)
    mean = np.zeros((len(error), 3))
    if p == 1:  # a pressure is above zero: its relative error is one of the logarithm
        mean[:, 0] = line[0] * np.exp(error[:, 0] / line[0])
    else:
        mean[:, :p] = line + error[:, :p]
    reach = 0.5 * (span[1] - span[0]) / 0.95  # 95 % of a uniform distribution is the span
    law = np.linspace(-reach, reach, len(error)) + 0.5 * (span[0] + span[1]) - exponent
    mean[:, 2] = exponent + error[:, p] + law
    place = mean.copy()
    place[:, :2] *= np.exp(deviation[:, :1])
    place[:, 2] += deviation[:, 1]
    for draws in (mean, place):
        draws[:, 2] = np.maximum(draws[:, 2], declared(Soil)["n"].lower)
    return mean, place


def _modulus(draws: Floats, depth: float, width: float) -> Floats:
    return np.asarray((draws[:, 0] + draws[:, 1] / width) * depth ** -draws[:, 2])
