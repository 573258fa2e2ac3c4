"""Shear tests: their table, and cohesion, friction angle and shear modulus fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import TableError
from soilml.identification.bevameter.plate_tests import thinned
from soilml.identification.bevameter.scatter import (
    SpreadEstimate,
    distinct_levels,
    pooled_scatter,
    relative_line,
    spread_estimate,
)
from soilml.io.table import Table

LEAST_POINTS = 2  # Points of a shear curve that its two parameters need
#: Usual standard deviations of repeated shear tests: of the logarithms of strength and of K.
USUAL_SCATTER = np.asarray([0.08, 0.3])
#: Ratio of the largest to the smallest normal stress below which cohesion and friction are not told
#: apart: what friction could add is then below the scatter of repeats.
LEAST_STRESS_RATIO = 1.15
#: Candidates of K, from a tenth of the smallest displacement to the upper limit; steps of 1 %.
UPPER_MODULUS = 2.0  # in largest displacements: beyond, a curve is a straight line
STEP = 0.01
MOST_STRENGTHS = 10  # Rows of one name and one normal stress that are strengths of repeats
END = 0.2  # Last part of a curve, as a fraction of its displacement, whose mean is its end
LEAST_LOADS = 4  # Loads from which on a bend of the failure line is looked for
#: Studentised size of a bend from which it is reported: chance gives it in 1 of 50 tables of five
#: tests.
SIGNIFICANT = 3.0


@dataclass(frozen=True)
class ShearTest:
    """One test: mean normal stress (Pa), and shear stress (Pa) at displacements (m), (k,) each.

    A displacement is infinite where the stress is that of the steady end of the test, or its
    strength where no curve was recorded.
    """

    name: str
    normal_stress: float
    displacement: Floats
    stress: Floats

    @property
    def has_curve(self) -> bool:
        """Whether stresses were recorded over displacements."""
        return bool(np.isfinite(self.displacement).any())


def read_shear_tests(table: Table) -> list[ShearTest]:
    r"""The tests of a table of shear tests with a plate, a box or a ring.

    .. math::
        \tau = \frac{3 T}{2 \pi (r_o^3 - r_i^3)}, \quad j = \frac{r_o + r_i}{2} \alpha, \quad
        \sigma = \frac{W}{\pi (r_o^2 - r_i^2)}

    for a ring that is rotated by an angle alpha with the torque T under the load W; the stress is
    taken as constant over the ring. A row whose displacement or angle is blank holds the steady
    shear stress at the end of the test. Where no row has one, each row is a test of its own, with
    its strength or largest torque, as most shear cells give it.

    table: Rows with `test`, and either `normal_stress_Pa`, `shear_stress_Pa` and
        `shear_displacement_m`, or `inner_radius_m`, `outer_radius_m`, `torque_Nm`, `angle_rad` and
        `load_N` (or `normal_stress_Pa`). Displacement and angle may be missing.

    Raises `TableError`, which names the missing column, or the test without a usable curve.

    References: Wong, Theory of Ground Vehicles, 2008, section 2.4, shear ring.
    """
    if len(table) == 0:
        raise TableError(f"{table.source}: the table has no row")
    displacement, stress, normal = _curves(table)
    tests = []
    names = table["test"]
    if not np.isfinite(displacement).any():
        names = _numbered(names.tolist())
        _refuse_lost_curves(table, normal)
    for name in dict.fromkeys(names.tolist()):
        rows = names == name
        sigma = normal[rows]
        sigma = sigma[np.isfinite(sigma)]
        if sigma.size == 0 or sigma.mean() <= 0.0:
            raise TableError(f"{table.source}: test {name} has no normal stress above zero")
        tests.append(_test(table, name, displacement[rows], stress[rows], sigma))
    return tests


def _refuse_lost_curves(table: Table, normal: Floats) -> None:
    """Raise `TableError` where a test has so many rows that these are samples of its curve."""
    pairs = list(zip(table["test"].tolist(), normal.tolist(), strict=True))
    for name, stress in dict.fromkeys(pairs):
        if (count := pairs.count((name, stress))) > MOST_STRENGTHS:
            key = "angle_rad" if "torque_Nm" in table else "shear_displacement_m"
            raise TableError(
                f"{table.source}: column {key} is missing: {count} rows of test {name} are samples "
                "of a curve; for strengths alone, give each test one row"
            )


def _numbered(names: Sequence[str]) -> NDArray[np.str_]:
    """The names of rows (n,), with a number where several rows have one."""
    return np.asarray(
        [
            f"{name} {names[: i + 1].count(name)}" if names.count(name) > 1 else name
            for i, name in enumerate(names)
        ]
    )


def _curves(table: Table) -> tuple[Floats, Floats, Floats]:
    """Displacement (m), shear stress and normal stress (Pa) of each row."""
    ring = "torque_Nm" in table
    if ring:
        for key in ("inner_radius_m", "outer_radius_m"):
            _require(table, key, "for a ring, with torque_Nm")
        inner, outer = table["inner_radius_m"], table["outer_radius_m"]
        if (wrong := ~(outer > inner)).any():
            row = int(np.argmax(wrong))
            raise TableError(
                f"{table.place(row)}, column outer_radius_m: {outer[row]:g} given; needed is a "
                f"radius above inner_radius_m, {inner[row]:g}"
            )
        displacement = _or_blank(table, "angle_rad") * 0.5 * (outer + inner)
        stress = 3.0 * table["torque_Nm"] / (2.0 * np.pi * (outer**3 - inner**3))
    else:
        _require(table, "shear_stress_Pa", "or those of a ring: torque_Nm, angle_rad, ...")
        displacement, stress = _or_blank(table, "shear_displacement_m"), table["shear_stress_Pa"]
    if "normal_stress_Pa" in table:
        return displacement, stress, table["normal_stress_Pa"]
    if not ring:
        _require(table, "normal_stress_Pa", "the normal stress of each row")
    _require(table, "load_N", "or normal_stress_Pa")
    return displacement, stress, table["load_N"] / (np.pi * (outer**2 - inner**2))


def _or_blank(table: Table, key: str) -> Floats:
    """A column (n,), NaN where the table has none."""
    return np.asarray(table[key], float) if key in table else np.full(len(table), np.nan)


def _require(table: Table, key: str, text: str) -> None:
    if key not in table:
        found = ", ".join(table.columns)
        raise TableError(f"{table.source}: column {key} is missing ({text}); found: {found}")


def _test(
    table: Table, name: str, displacement: Floats, stress: Floats, sigma: Floats
) -> ShearTest:
    j = np.where(np.isnan(displacement), np.inf, displacement)
    usable = np.isfinite(stress) & (j > 0.0)
    j, stress = j[usable], stress[usable]
    least = LEAST_POINTS if np.isfinite(j).any() else 1
    if np.unique(j).size < least or not np.any(stress > 0.0):
        raise TableError(
            f"{table.source}: test {name} needs {LEAST_POINTS} or more samples with a displacement "
            f"and a shear stress above zero; it has {j.size}"
        )
    curve = np.isfinite(j)
    mean = float(sigma.mean())
    if not curve.any():
        return ShearTest(name, mean, np.asarray([np.inf]), np.asarray([stress.mean()]))
    means = thinned(j[curve], stress[curve])
    j, stress = (np.append(a, b[~curve]) for a, b in zip(means, (j, stress), strict=True))
    return ShearTest(name, mean, j, stress)


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

    tests: tuple[ShearTest, ...]
    curves: tuple[ShearCurve, ...]  # fitted to each
    stresses: tuple[float, ...]  # distinct normal stresses, Pa
    cohesion: SpreadEstimate | None  # Pa; None where there is one normal stress
    friction_angle: SpreadEstimate | None  # rad; likewise
    strength: SpreadEstimate  # at the mean normal stress, Pa
    shear_modulus: SpreadEstimate | None  # geometric mean, m; None where none has a curve
    #: (c, phi) of the lighter and of the heavier half of the loads where the failure line is
    #: curved; else empty
    halves: tuple[tuple[float, float], ...]

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine, by name."""
        found = {} if self.shear_modulus is None else {"shear_modulus": self.shear_modulus}
        if self.cohesion is None or self.friction_angle is None:
            return {"shear_strength": self.strength, **found}
        return {"cohesion": self.cohesion, "friction_angle": self.friction_angle, **found}


def fit_shear_strength(tests: Sequence[ShearTest]) -> ShearFit:
    r"""Fit c, phi and K to shear tests at one or several normal stresses.

    .. math:: \tau = (c + \sigma \tan\varphi) (1 - e^{-j / K})

    Strength and K are fitted to each test, then the line to the strengths by least squares of
    relative residuals. The scatter of the tests about line and mean gives the uncertainty, together
    with the deviation of the ends and peaks of the curves from the fitted shape. A line that meets
    the axis below zero is drawn again through the origin.

    References: Janosi and Hanamoto, Proc. 1st ISTVS, 1961. Wong, Theory of Ground Vehicles, 2008,
    section 2.4.
    """
    curves = tuple(fit_shear_curve(test) for test in tests)
    sigma = np.asarray([test.normal_stress for test in tests])
    strength = np.asarray([curve.strength for curve in curves])
    log_modulus = np.log([curve.modulus for curve in curves])
    recorded = np.isfinite(log_modulus)
    stresses = distinct_levels(sigma)
    columns = np.stack([np.ones(sigma.size), sigma], axis=1)
    if stresses[-1] < LEAST_STRESS_RATIO * stresses[0]:
        columns = columns[:, 1:]
    line, hat, fitted = relative_line(columns, strength)
    through_origin = len(line) == 2 and line[0] < 0.0
    if through_origin:
        slope = relative_line(columns[:, 1:], strength)
        line, fitted = np.append(0.0, slope[0]), slope[2]
    mean_log = float(log_modulus[recorded].mean()) if recorded.any() else 0.0
    about = np.where(recorded, log_modulus - mean_log, 0.0)
    residual = np.stack([np.log(strength / fitted), about], axis=1)
    scatter = pooled_scatter(residual, USUAL_SCATTER, columns.shape[1])
    p, s = len(line), scatter.covariance
    covariance = np.zeros((p + 1, p + 1))
    covariance[:p, :p] = hat @ hat.T * s[0, 0]
    covariance[p, p] = s[1, 1] / max(int(recorded.sum()), 1)
    error, deviation = scatter.draws(covariance)
    modulus = np.exp(mean_log + error[:, p])
    draws = (line + error[:, :p]) * _shape_factors(curves, len(error))[:, None]
    other = draws * np.exp(deviation[:, :1])
    middle = float(sigma.mean())
    at = np.asarray([1.0, middle])[-p:]
    halves = _halves(sigma, strength) if len(stresses) >= LEAST_LOADS else ()
    c = phi = None
    if p == 2:
        above = [np.maximum(d, 0.0) for d in (line[None, :], draws, other)]
        value, mean, place = (d[:, 0] for d in above)
        c = spread_estimate(float(value[0]), mean, place, "Pa")
        c = _with(c, [max(half[0], 0.0) for half in halves])
        value, mean, place = (np.arctan(d[:, 1]) for d in above)
        phi = spread_estimate(float(value[0]), mean, place, "rad")
        phi = _with(phi, [half[1] for half in halves])
    k = None
    if recorded.any():
        elsewhere = modulus * np.exp(deviation[:, 1])
        k = spread_estimate(float(np.exp(mean_log)), modulus, elsewhere, "m")
    total = spread_estimate(float(line @ at), draws @ at, other @ at, "Pa")
    return ShearFit(tuple(tests), curves, stresses, c, phi, total, k, halves)


def fit_shear_curve(test: ShearTest) -> ShearCurve:
    """Least squares of strength and K; the steady end of a test counts as one more point."""
    j, stress = test.displacement, test.stress
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
    scale = np.abs(columns).max(axis=0)
    normal = np.linalg.inv((columns / scale).T @ (columns / scale))
    x = normal @ (columns / scale).sum(axis=0)
    residual = 1.0 - (columns / scale) @ x
    freedom = sigma.size - 3
    std = np.sqrt(normal[2, 2] * max(float(residual @ residual), 1e-12) / freedom)
    if freedom < 1 or abs(x[2]) < SIGNIFICANT * std:
        return ()
    halves = []
    for part in (sigma <= np.median(sigma), sigma >= np.median(sigma)):
        own = np.stack([np.ones(part.sum()), sigma[part]], axis=1)
        c, slope = relative_line(own, strength[part])[0]
        halves.append((float(c), float(np.arctan(max(slope, 0.0)))))
    return tuple(halves)


def _with(estimate: SpreadEstimate, values: Sequence[float]) -> SpreadEstimate:
    """The estimate with ranges that contain these values too."""
    first, second = (
        (min(low, *values, low), max(high, *values, high))
        for low, high in (estimate.mean_95, estimate.another_place_95)
    )
    return SpreadEstimate(estimate.value, first, second, estimate.unit)
