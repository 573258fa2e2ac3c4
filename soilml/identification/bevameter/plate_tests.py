"""Plate-sinkage tests: their table, and Bekker's law fitted to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import TableError
from soilml.identification.bevameter.scatter import (
    Scatter,
    SpreadEstimate,
    distinct_levels,
    pooled_scatter,
    relative_line,
    spread_estimate,
)
from soilml.io.table import Table
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: Most points of a curve that are kept: means over equal steps of sinkage, so that neither a slow
#: part of a test nor a high sampling rate counts more than the rest.
MOST_POINTS = 25
#: Points of the loading curve that an exponent needs: two for the line, one to see a misfit.
LEAST_POINTS = 3
SAME_SIZE = 0.01  # Variation of a plate's size within a test above which the rows are not one test
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
class PlateTest:
    """The loading curve of one test: mean pressure (Pa) at sinkages (m), (k,) each.

    `size` is the smaller dimension of the plate (m): the radius of a round one, the width of a
    rectangular one. `omitted` counts the samples without pressure, without sinkage, or less deep
    than an earlier one.
    """

    name: str
    size: float
    sinkage: Floats
    pressure: Floats
    omitted: int


def read_plate_tests(table: Table) -> list[PlateTest]:
    """The tests of a table of plate-sinkage tests.

    table: Rows with `test`, `sinkage_m`, the plate as `plate_radius_m`, as `plate_width_m` and
        `plate_length_m`, or as `plate_area_m2` (of a round plate), and `pressure_Pa` or `load_N`.

    Raises `TableError`, which names the missing column, or the test without a usable curve.
    """
    if len(table) == 0:
        raise TableError(f"{table.source}: the table has no row")
    size, area = _plate(table)
    if "pressure_Pa" in table:
        pressure = table["pressure_Pa"]
    elif "load_N" in table:
        pressure = table["load_N"] / area
    else:
        raise TableError(f"{table.source}: column pressure_Pa is missing; pressure_Pa or load_N is")
    sinkage = table["sinkage_m"]
    tests = []
    for name, rows in _rows_of_tests(table):
        own = size[rows]
        if np.ptp(own) > SAME_SIZE * own.mean():
            raise TableError(
                f"{table.source}: test {name} has plates of {own.min():g} and {own.max():g} m; "
                "give each plate a test of its own"
            )
        tests.append(_loading_curve(table, name, float(own[0]), sinkage[rows], pressure[rows]))
    return tests


def _rows_of_tests(table: Table) -> list[tuple[str, NDArray[np.int64]]]:
    names, first = np.unique(table["test"], return_index=True)
    return [(str(n), np.flatnonzero(table["test"] == n)) for n in names[np.argsort(first)]]


def _plate(table: Table) -> tuple[Floats, Floats]:
    """Smaller dimension (m) and area (m^2) of the plate in each row."""
    shapes: dict[tuple[str, ...], Callable[..., tuple[Floats, Floats]]] = {
        ("plate_radius_m",): lambda r: (r, np.pi * r**2),
        ("plate_width_m", "plate_length_m"): lambda b, m: (np.minimum(b, m), b * m),
        ("plate_area_m2",): lambda a: (np.sqrt(a / np.pi), a),
    }
    for keys, dimensions in shapes.items():
        if all(key in table for key in keys):
            return dimensions(*(table[key] for key in keys))
    raise TableError(
        f"{table.source}: the size of the plate is missing; needed is plate_radius_m, or "
        "plate_area_m2 of a round plate, or plate_width_m and plate_length_m"
    )


def _loading_curve(
    table: Table, name: str, size: float, sinkage: Floats, pressure: Floats
) -> PlateTest:
    """The samples that are deeper than all before, in at most `MOST_POINTS` points."""
    usable = np.isfinite(sinkage) & np.isfinite(pressure) & (sinkage > 0.0) & (pressure > 0.0)
    z, p = sinkage[usable], pressure[usable]
    deeper = z > np.maximum.accumulate(np.append(0.0, z))[:-1]
    z, p = z[deeper], p[deeper]
    if np.unique(z).size < LEAST_POINTS:
        raise TableError(
            f"{table.source}: test {name} needs {LEAST_POINTS} or more samples with growing "
            f"sinkage and a pressure above zero; it has {z.size}"
        )
    omitted = sinkage.size - z.size
    return PlateTest(name, size, *thinned(z, p), omitted)


def thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The points of a curve; means over `MOST_POINTS` equal steps of x where there are more."""
    if x.size <= MOST_POINTS:
        return x, y
    step = np.minimum((x / x.max() * MOST_POINTS).astype(np.int64), MOST_POINTS - 1)
    count = np.bincount(step, minlength=MOST_POINTS)
    kept = count > 0
    steps = (np.bincount(step, v, MOST_POINTS)[kept] / count[kept] for v in (x, y))
    return next(steps), next(steps)


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

    tests: tuple[PlateTest, ...]
    curves: tuple[PlateCurve, ...]  # the law fitted to each
    depth: float  # z_0 (m), where pressure and exponent are least correlated
    sizes: tuple[float, ...]  # distinct sizes b of the plates, m
    pressure: Floats  # A (Pa) and B (Pa m) at the reference depth; B is 0 where there is one size
    exponent: float  # n
    mean_draws: Floats  # (draws, 3) of A, B and n: of the mean
    place_draws: Floats  # and of another place of the soil

    @property
    def several_sizes(self) -> bool:
        """Whether kc and kphi are estimated apart."""
        return self.sizes[-1] > LEAST_SIZE_RATIO * self.sizes[0]

    @property
    def moduli(self) -> tuple[float, float]:
        """Estimates of kc and kphi; kc is 0 where there is one size."""
        scale = self.depth**-self.exponent
        return float(self.pressure[1] * scale), float(self.pressure[0] * scale)

    def modulus(self, width: float) -> SpreadEstimate:
        """kc / b + kphi for a width b (m)."""
        kc, kphi = self.moduli
        value, unit = kc / width + kphi, "N/m^(n+2)"
        return self._estimate(value, unit, lambda d: (d[0] + d[1] / width) * self.depth ** -d[2])

    def pressure_at_depth(self, size: float) -> SpreadEstimate:
        """Pressure at the reference depth under a plate of a size (m)."""
        value = float(self.pressure @ [1.0, 1.0 / size])
        return self._estimate(value, "Pa", lambda d: d[0] + d[1] / size)

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine: n, and kc with kphi, or k for the one width tested."""
        found = {"n": self._estimate(self.exponent, "1", lambda d: d[2])}
        if not self.several_sizes:
            return found | {"k": self.modulus(self.sizes[0])}
        kc, kphi = self.moduli
        z = self.depth
        found["kc"] = self._estimate(kc, "N/m^(n+1)", lambda d: d[1] * z ** -d[2])
        found["kphi"] = self._estimate(kphi, "N/m^(n+2)", lambda d: d[0] * z ** -d[2])
        return found

    def _estimate(self, value: float, unit: str, of: Callable[[Floats], Floats]) -> SpreadEstimate:
        return spread_estimate(value, of(self.mean_draws.T), of(self.place_draws.T), unit)


def fit_pressure_sinkage(tests: Sequence[PlateTest]) -> PressureSinkageFit:
    r"""Fit :math:`p = (k_c / b + k_\varphi) z^n` to plate tests of one or several sizes.

    Each test is fitted on its own by Wong's least squares of the logarithm with weights p^2, at a
    common reference depth z_0; the pressures there are then a straight line in 1 / b. The unit is
    the test: how the results of the tests scatter about that line, and not the number of samples,
    gives the uncertainty. It contains the bend of the curves in the logarithm, as an exponent
    that is not the same at all depths.

    References: Bekker, Introduction to Terrain-Vehicle Systems, 1969. Wong, J. Terramechanics
    17(1), 1980, weighted least squares of pressure-sinkage data.
    """
    depth = _reference_depth(tests)
    curves = tuple(_fit_curve(test, depth) for test in tests)
    size = np.asarray([test.size for test in tests])
    pressure = np.exp([curve.log_pressure for curve in curves])
    exponents = np.asarray([curve.exponent for curve in curves])
    sizes = distinct_levels(size)
    columns = np.stack([np.ones(size.size), 1.0 / size], axis=1)
    if sizes[-1] <= LEAST_SIZE_RATIO * sizes[0]:
        columns = columns[:, :1]
    line, hat, fitted = relative_line(columns, pressure)
    exponent = float(exponents.mean())
    residual = np.stack([np.log(pressure / fitted), exponents - exponent], axis=1)
    scatter = pooled_scatter(residual, USUAL_SCATTER, columns.shape[1])
    mean, place = _draws(line, hat, exponent, scatter, _exponent_span(curves, exponent))
    full = np.append(line, np.zeros(2 - line.size))
    return PressureSinkageFit(tuple(tests), curves, depth, sizes, full, exponent, mean, place)


def _reference_depth(tests: Sequence[PlateTest]) -> float:
    """Mean of log depth with the weights of the fit, each test with the same weight in all."""
    means = [np.average(np.log(t.sinkage), weights=t.pressure**2) for t in tests]
    return float(np.exp(np.mean(means)))


def _fit_curve(test: PlateTest, depth: float) -> PlateCurve:
    x, y = np.log(test.sinkage / depth), np.log(test.pressure)
    exponent, level = np.polyfit(x, y, 1, w=test.pressure)
    residual = test.pressure * (y - level - exponent * x)
    misfit = float(np.sqrt(np.sum(residual**2) / np.sum(test.pressure**2)))
    low = max(float(test.sinkage[0]), SHALLOW * float(test.sinkage[-1]))
    middle = np.log(np.sqrt(low * test.sinkage[-1]) / depth)
    shallow = (x <= middle) & (test.sinkage >= low)
    deep = x >= middle
    halves = float("nan"), float("nan")
    if shallow.sum() >= 2 and deep.sum() >= 2:
        first, second = (float(np.polyfit(x[h], y[h], 1)[0]) for h in (shallow, deep))
        halves = first, second
    return PlateCurve(float(level), float(exponent), halves, misfit)


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
