"""Bekker's law fitted to plate tests, and Mohr and Coulomb's with Janosi's curve to shear tests.

A curve is fitted to each test; a straight line goes through one value of each, its pressure at a
reference depth over 1 / b or its strength over the normal stress (`TestLine`). How the tests
scatter about it, and not the number of samples, gives the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.identification.bevameter.scatter import (
    LawDraws,
    SpreadEstimate,
    TestLine,
    distinct_levels,
    relative_line,
)
from soilml.identification.bevameter.tables import StressCurve
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: Usual standard deviations of repeated plate tests in a carefully prepared bed, of the logarithm
#: of the pressure at one depth and of the exponent, and of repeated shear tests, of the logarithms
#: of strength and of K. Loose beds scatter more, and their repeats show it.
PLATE_SCATTER, SHEAR_SCATTER = np.asarray([0.15, 0.1]), np.asarray([0.08, 0.3])
#: Ratio of the largest to the smallest plate below which kc is not estimated, and of normal
#: stresses below which cohesion and friction are not told apart: what they could add is then below
#: the scatter of repeats.
LEAST_SIZE_RATIO, LEAST_STRESS_RATIO = 1.1, 1.15
#: Fraction of the largest depth below which a curve is not used for its bend: there an error of
#: the zero is a large part of the sinkage.
SHALLOW = 0.1
#: Candidates of K: up to so many largest displacements, beyond which a curve is a straight line, in
#: steps of 1 %.
UPPER_MODULUS, STEP = 2.0, 0.01
END = 0.2  # Last part of a curve, as a fraction of its displacement, whose mean is its end
LEAST_LOADS = 4  # Loads from which on a bend of the failure line is looked for
#: Studentised size of a bend from which it is reported: chance gives it in 1 of 50 tables of five
#: tests.
SIGNIFICANT = 3.0


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
    r"""Bekker's law fitted to N tests: :math:`p(z_0, b) = A + B / b` and the exponent n."""

    tests: tuple[StressCurve, ...]
    curves: tuple[PlateCurve, ...]  # the law fitted to each
    depth: float  # z_0 (m), where pressure and exponent are least correlated
    sizes: tuple[float, ...]  # distinct sizes b of the plates, m
    draws: LawDraws  # of A (Pa), B (Pa m; 0 where there is one size), and n

    @property
    def several_sizes(self) -> bool:
        """Whether kc and kphi are estimated apart."""
        return self.sizes[-1] > LEAST_SIZE_RATIO * self.sizes[0]

    @property
    def moduli(self) -> tuple[float, float]:
        """Estimates of kc and kphi; kc is 0 where there is one size."""
        pressure, by_size, exponent = map(float, self.draws.value)
        scale = self.depth**-exponent
        return by_size * scale, pressure * scale

    def modulus(self, width: float) -> SpreadEstimate:
        """kc / b + kphi for a width b (m)."""
        z = self.depth
        return self.draws.estimate(lambda d: (d[0] + d[1] / width) * z ** -d[2], "N/m^(n+2)")

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine: n, and kc with kphi, or k for the one width tested."""
        z, found = self.depth, {"n": self.draws.estimate(lambda d: d[2], "1")}
        if not self.several_sizes:
            return found | {"k": self.modulus(self.sizes[0])}
        found["kc"] = self.draws.estimate(lambda d: d[1] * z ** -d[2], "N/m^(n+1)")
        found["kphi"] = self.draws.estimate(lambda d: d[0] * z ** -d[2], "N/m^(n+2)")
        return found


def fit_pressure_sinkage(tests: Sequence[StressCurve]) -> PressureSinkageFit:
    r"""Fit :math:`p = (k_c / b + k_\varphi) z^n` to plate tests of one or several sizes.

    Each test is fitted on its own by Wong's least squares of the logarithm with weights p^2, at a
    common reference depth z_0; the pressures there are then a straight line in 1 / b. The
    uncertainty contains the bend of the curves in the logarithm, as an exponent that is not the
    same at all depths.

    References: Bekker, Introduction to Terrain-Vehicle Systems, 1969. Wong, J. Terramechanics
    17(1), 1980, weighted least squares of pressure-sinkage data.
    """
    means = [np.average(np.log(t.x), weights=t.stress**2) for t in tests]
    depth = float(np.exp(np.mean(means)))
    curves = tuple(_fit_plate_curve(test, depth) for test in tests)
    size = np.asarray([test.level for test in tests])
    exponents = np.asarray([curve.exponent for curve in curves])
    sizes = distinct_levels(size)
    columns = np.stack([np.ones(size.size), 1.0 / size], axis=1)
    columns = columns[:, : 1 + (sizes[-1] > LEAST_SIZE_RATIO * sizes[0])]
    pressure = np.exp([curve.log_pressure for curve in curves])
    line = TestLine.of(columns, pressure, exponents, PLATE_SCATTER, above_zero=False)
    p, exponent = len(line.coefficients), float(exponents.mean())
    mean = np.zeros((len(line.error), 3))
    mean[:, :p] = line.coefficients + line.error[:, :p]
    if p == 1:  # a pressure is above zero: its relative error is one of the logarithm
        mean[:, 0] = line.coefficients[0] * np.exp(line.error[:, 0] / line.coefficients[0])
    # from the least to the largest of the exponent and the mean exponents of the halves: 95 % of a
    # uniform distribution
    halves = np.asarray([c.halves for c in curves if np.isfinite(c.halves).all()])
    span = np.asarray([exponent, *(halves.mean(axis=0) if halves.size else ())])
    reach = 0.5 * np.ptp(span) / 0.95
    law = np.linspace(-reach, reach, len(mean)) + 0.5 * (span.min() + span.max()) - exponent
    mean[:, 2] = exponent + line.error[:, p] + law
    place = mean.copy()
    place[:, :2] *= np.exp(line.deviation[:, :1])
    place[:, 2] += line.deviation[:, 1]
    for draws in (mean, place):
        draws[:, 2] = np.maximum(draws[:, 2], declared(Soil)["n"].lower)
    value = np.asarray([*line.coefficients, *np.zeros(2 - p), exponent])
    law_draws = LawDraws(value, mean.T, place.T)
    return PressureSinkageFit(tuple(tests), curves, depth, sizes, law_draws)


def _fit_plate_curve(test: StressCurve, depth: float) -> PlateCurve:
    x, y = np.log(test.x / depth), np.log(test.stress)
    exponent, level = np.polyfit(x, y, 1, w=test.stress)
    residual = test.stress * (y - level - exponent * x)
    misfit = float(np.sqrt(np.sum(residual**2) / np.sum(test.stress**2)))
    low = max(float(test.x[0]), SHALLOW * float(test.x[-1]))
    middle = np.log(np.sqrt(low * test.x[-1]) / depth)
    parts = (x <= middle) & (test.x >= low), x >= middle
    halves = float("nan"), float("nan")
    if min(part.sum() for part in parts) >= 2:
        first, second = (float(np.polyfit(x[part], y[part], 1)[0]) for part in parts)
        halves = first, second
    return PlateCurve(float(level), float(exponent), halves, misfit)


@dataclass(frozen=True)
class ShearCurve:
    """Janosi and Hanamoto's curve fitted to one test: strength (Pa) and K (m).

    `peak` and `end` are the largest stress and that of the end (Pa); `mobilised` is the fraction of
    the strength that is reached at the largest displacement; `misfit` is the relative residual.
    Where a test has its strength alone, `modulus` is NaN.
    """

    strength: float
    modulus: float
    peak: float
    end: float
    mobilised: float
    misfit: float


@dataclass(frozen=True)
class ShearFit:
    """Mohr and Coulomb's line through the strengths of N tests, and K."""

    tests: tuple[StressCurve, ...]
    curves: tuple[ShearCurve, ...]  # fitted to each
    stresses: tuple[float, ...]  # distinct normal stresses, Pa
    draws: LawDraws  # of c (Pa; 0 where there is one normal stress), tan phi, and K (m)
    #: (c, phi) of the lighter and of the heavier half of the loads where the failure line is
    #: curved; else empty
    halves: tuple[tuple[float, float], ...]

    @property
    def several_stresses(self) -> bool:
        """Whether cohesion and friction are told apart."""
        return self.stresses[-1] >= LEAST_STRESS_RATIO * self.stresses[0]

    @property
    def strength(self) -> SpreadEstimate:
        """The strength at the mean normal stress."""
        middle = float(np.mean([test.level for test in self.tests]))
        return self.draws.estimate(lambda d: d[0] + middle * d[1], "Pa")

    @property
    def shear_modulus(self) -> SpreadEstimate | None:
        """The geometric mean of K; None where no test has a curve."""
        measured = any(test.has_curve for test in self.tests)
        return self.draws.estimate(lambda d: d[2], "m") if measured else None

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine, by name."""
        modulus = self.shear_modulus
        found = {} if modulus is None else {"shear_modulus": modulus}
        if not self.several_stresses:
            return {"shear_strength": self.strength, **found}
        c = self.draws.estimate(
            lambda d: np.maximum(d[0], 0.0), "Pa", [max(half[0], 0.0) for half in self.halves]
        )
        phi = self.draws.estimate(
            lambda d: np.arctan(np.maximum(d[1], 0.0)), "rad", [half[1] for half in self.halves]
        )
        return {"cohesion": c, "friction_angle": phi, **found}


def fit_shear_strength(tests: Sequence[StressCurve]) -> ShearFit:
    r"""Fit c, phi and K to shear tests at one or several normal stresses.

    .. math:: \tau = (c + \sigma \tan\varphi) (1 - e^{-j / K})

    Strength and K are fitted to each test, then the line to the strengths by least squares of
    relative residuals. The uncertainty contains the deviation of the ends and peaks of the curves
    from the fitted shape. A line that meets the axis below zero is drawn again through the origin.

    References: Janosi and Hanamoto, Proc. 1st ISTVS, 1961. Wong, Theory of Ground Vehicles, 2008,
    section 2.4.
    """
    curves = tuple(fit_shear_curve(test) for test in tests)
    sigma = np.asarray([test.level for test in tests])
    strength = np.asarray([curve.strength for curve in curves])
    log_modulus = np.log([curve.modulus for curve in curves])
    stresses = distinct_levels(sigma)
    columns = np.stack([np.ones(sigma.size), sigma], axis=1)
    columns = columns[:, int(stresses[-1] < LEAST_STRESS_RATIO * stresses[0]) :]
    line = TestLine.of(columns, strength, log_modulus, SHEAR_SCATTER, above_zero=True)
    p = len(line.coefficients)
    mean = np.zeros((len(line.error), 3))
    mean[:, 2 - p : 2] = line.coefficients + line.error[:, :p]
    mean[:, :2] *= _shape_factors(curves, len(mean))[:, None]
    mean[:, 2] = np.exp(line.mean + line.error[:, p])
    place = mean * np.exp(line.deviation[:, [0, 0, 1]])
    value = np.asarray([*np.zeros(2 - p), *line.coefficients, np.exp(line.mean)])
    halves = _halves(sigma, strength) if len(stresses) >= LEAST_LOADS else ()
    return ShearFit(tuple(tests), curves, stresses, LawDraws(value, mean.T, place.T), halves)


def fit_shear_curve(test: StressCurve) -> ShearCurve:
    """Least squares of strength and K; the steady end of a test counts as one more point."""
    j, stress = test.x, test.stress
    if not test.has_curve:
        strength = float(stress.mean())
        return ShearCurve(strength, float("nan"), strength, strength, 1.0, 0.0)
    finite = j[np.isfinite(j)]
    low, high = np.log(0.1 * finite.min()), np.log(UPPER_MODULUS * finite.max())
    candidates = np.exp(np.arange(low, high, STEP))
    mobilised = -np.expm1(-j / candidates[:, None])  # (candidates, k)
    strengths = (mobilised @ stress) / np.sum(mobilised**2, axis=1)
    squares = np.sum((stress - strengths[:, None] * mobilised) ** 2, axis=1)
    best = int(np.argmin(squares))
    last = stress[(j >= (1.0 - END) * finite.max())]
    return ShearCurve(
        strength=float(strengths[best]),
        modulus=float(candidates[best]),
        peak=float(stress.max()),
        end=float(stress[-1] if not np.isfinite(j[-1]) else last.mean()),
        mobilised=float(mobilised[best].max()),
        misfit=float(np.sqrt(squares[best] / np.sum(stress**2))),
    )


def _shape_factors(curves: Sequence[ShearCurve], count: int) -> Floats:
    """Factors (count,) on the strength, from the end of the curves to their peak.

    Uniform in the logarithm; 1 where the curves have the shape of Janosi and Hanamoto.
    """
    reached = [(c, c.mobilised * c.strength) for c in curves]
    low = float(np.mean([min(np.log(c.end / fitted), 0.0) for c, fitted in reached]))
    high = float(np.mean([max(np.log(c.peak / fitted), 0.0) for c, fitted in reached]))
    return np.exp(np.linspace(low, high, count))


def _halves(sigma: Floats, strength: Floats) -> tuple[tuple[float, float], ...]:
    """(c, phi) of the lighter and the heavier tests, where a parabola is needed; else empty."""
    columns = np.stack([np.ones(sigma.size), sigma, sigma**2], axis=1) / strength[:, None]
    columns /= np.abs(columns).max(axis=0)
    normal = np.linalg.inv(columns.T @ columns)
    x = normal @ columns.sum(axis=0)
    residual, freedom = 1.0 - columns @ x, sigma.size - 3
    std = np.sqrt(normal[2, 2] * max(float(residual @ residual), 1e-12) / freedom)
    if freedom < 1 or abs(x[2]) < SIGNIFICANT * std:
        return ()
    halves = []
    for part in (sigma <= np.median(sigma), sigma >= np.median(sigma)):
        own = np.stack([np.ones(part.sum()), sigma[part]], axis=1)
        c, slope = relative_line(own, strength[part])[0]
        halves.append((float(c), float(np.arctan(max(slope, 0.0)))))
    return tuple(halves)
