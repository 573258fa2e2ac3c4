"""Shear tests by their formulas."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter_tables import PHI, C, K, shear
from remarked import remarked

from soilml.errors import TableError
from soilml.identification.bevameter import (
    bevameter,
    shear_tests,
)
from soilml.identification.bevameter.scatter import (
    spread_estimate,
)
from soilml.identification.bevameter.shear_tests import ShearTest, read_shear_tests
from soilml.io.table import Table


def test_a_spread_is_that_of_the_middle_nineteen_of_twenty_draws():
    draws = np.linspace(0.0, 1.0, 1001)
    found = spread_estimate(0.4, draws, 10.0 * draws, "Pa")
    assert found.mean_95 == pytest.approx((0.025, 0.975))
    assert found.another_place_95 == pytest.approx((0.25, 9.75))
    assert found.as_json() == {
        "value": 0.4,
        "mean_95": list(found.mean_95),
        "another_place_95": list(found.another_place_95),
        "unit": "Pa",
    }
    within = shear_tests._with(found, [-0.1, 5.0])
    assert within.mean_95 == (-0.1, 5.0) and within.value == 0.4
    assert within.another_place_95 == pytest.approx((-0.1, 9.75))
    assert shear_tests._with(found, []) == found


def curve(j, stress, sigma=10e3, variation=0.0, name="a"):
    return ShearTest(name, sigma, np.asarray(j), np.asarray(stress), variation)


def test_a_shear_curve_gives_strength_and_modulus_and_its_shape():
    j = np.linspace(0.002, 0.05, 21)
    exact = shear_tests.fit_shear_curve(curve(j, 5e3 * -np.expm1(-j / 0.01)))
    assert exact.strength == pytest.approx(5e3, rel=2e-3)
    assert exact.modulus == pytest.approx(0.01, rel=0.01)
    assert exact.mobilised == pytest.approx(-np.expm1(-0.05 / exact.modulus), rel=1e-9)
    assert exact.peak == pytest.approx(5e3 * -np.expm1(-5.0))
    late = 5e3 * -np.expm1(-j[j >= 0.8 * 0.05] / 0.01)
    assert exact.end == pytest.approx(late.mean(), rel=1e-9)
    assert exact.misfit < 1e-3
    # a steady end is a point at an infinite displacement
    steady = np.append(j, np.inf), np.append(5e3 * -np.expm1(-j / 0.01), 4.5e3)
    found = shear_tests.fit_shear_curve(curve(*steady))
    assert found.end == 4.5e3 and found.mobilised == 1.0 and found.strength < 5e3
    off = steady[1] - found.strength * -np.expm1(-steady[0] / found.modulus)
    misfit = np.sqrt(np.sum(off**2) / np.sum(steady[1] ** 2))
    assert found.misfit == pytest.approx(misfit, rel=1e-9)
    # a straight line has no modulus below twice its length
    straight = shear_tests.fit_shear_curve(curve(j, 1e5 * j))
    assert straight.modulus == pytest.approx(0.1, rel=0.011)


def test_shape_factors_run_from_the_end_of_the_curves_to_their_peak():
    base = shear_tests.ShearCurve(100.0, 0.01, 100.0, 100.0, 1.0, 0.0)
    assert shear_tests._shape_factors([base], 3).tolist() == [1.0, 1.0, 1.0]
    bent = [replace(base, peak=121.0, end=81.0), base]
    np.testing.assert_allclose(shear_tests._shape_factors(bent, 3)[[0, 2]], [0.9, 1.1])
    rising = replace(base, peak=100.0, end=100.0, mobilised=0.5)
    np.testing.assert_allclose(shear_tests._shape_factors([rising], 2), [1.0, 2.0])


def test_halves_of_a_failure_line_are_found_where_a_parabola_is_needed():
    sigma = np.linspace(2e3, 20e3, 7)
    jitter = 1.0 + 0.005 * np.asarray([1, -1, 1, -1, 1, -1, 1])
    assert shear_tests._halves(sigma, (800.0 + 0.7 * sigma) * jitter) == ()
    middle = np.median(sigma)
    bent = 500.0 + 0.8 * np.minimum(sigma, middle) + 0.4 * np.maximum(sigma - middle, 0.0)
    (c0, phi0), (c1, phi1) = shear_tests._halves(sigma, bent)
    assert (c0, c1) == pytest.approx((500.0, 500.0 + 0.4 * middle))
    assert np.tan([phi0, phi1]) == pytest.approx([0.8, 0.4])
    falling = 9e3 + 0.8 * np.minimum(sigma, middle) - 0.4 * np.maximum(sigma - middle, 0.0)
    assert shear_tests._halves(sigma, falling)[1][1] == 0.0
    assert shear_tests._halves(sigma[:4], 800.0 + 0.7 * sigma[:4]) == ()


def test_a_trend_is_reported_where_it_is_three_standard_errors():
    x = np.linspace(0.0, 1.0, 6)
    noise = 0.1 * np.asarray([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])
    slope, residuals, *_ = np.polyfit(x, noise, 1, full=True)
    std = np.sqrt(residuals[0] / 4.0 / np.sum((x - x.mean()) ** 2))
    for times, reported in ((2.9, False), (3.1, True), (-3.1, True), (-2.9, False)):
        wanted = times * std
        found = shear_tests._trend(5.0 + x, 2.0 + noise + (wanted - slope[0]) * x)
        assert found == (pytest.approx(wanted) if reported else 0.0)


def test_a_failure_line_has_relative_scatter_and_goes_above_zero():
    found = bevameter(shear=shear(scatter=0.1)).shear
    at = found.cohesion.value + np.mean([5e3, 10e3, 20e3]) * np.tan(found.friction_angle.value)
    assert found.strength.value == pytest.approx(at, rel=1e-9)
    assert found.shear_modulus.value == pytest.approx(K, rel=0.01)
    assert found.cohesion.mean_95[0] >= 0.0
    low, high = found.strength.another_place_95
    assert low < found.strength.mean_95[0] < at < found.strength.mean_95[1] < high
    assert found.halves == () and found.modulus_trend == 0.0
    table = shear(stresses=(2e3, 5e3, 10e3, 20e3), repeats=1)
    j = table["shear_displacement_m"]
    modulus = K * (table["normal_stress_Pa"] / 5e3) ** 0.5
    tau = (C + table["normal_stress_Pa"] * np.tan(PHI)) * -np.expm1(-j / modulus)
    grown = bevameter(shear=Table(table.columns | {"shear_stress_Pa": tau}))
    assert grown.shear.modulus_trend == pytest.approx(0.5, abs=0.03)
    assert remarked(grown.remarks, "K grows with the normal stress: 7.6 to 24 mm")
    # two stresses that differ by less than scatter are one
    one = bevameter(shear=shear(stresses=(10e3, 11.4e3))).shear
    two = bevameter(shear=shear(stresses=(10e3, 11.6e3))).shear
    assert one.cohesion is None and two.cohesion is not None


def test_rings_are_read_by_their_formulas_and_refused_inside_out():
    ring = {
        "test": np.asarray(["r", "r"]),
        "inner_radius_m": np.full(2, 0.05),
        "outer_radius_m": np.full(2, 0.08),
        "angle_rad": np.asarray([0.1, 0.4]),
        "torque_Nm": np.asarray([1.0, 2.0]),
        "load_N": np.asarray([99.0, 101.0]),
    }
    test = read_shear_tests(Table(ring))[0]
    np.testing.assert_allclose(test.displacement, 0.065 * ring["angle_rad"])
    twist = 3.0 * ring["torque_Nm"] / (2.0 * np.pi * (0.08**3 - 0.05**3))
    np.testing.assert_allclose(test.stress, twist)
    assert test.normal_stress == pytest.approx(100.0 / (np.pi * (0.08**2 - 0.05**2)))
    assert test.normal_variation == pytest.approx(0.01)
    swapped = ring | {"outer_radius_m": np.asarray([0.08, 0.05])}
    with pytest.raises(TableError, match=r"row 2, column outer_radius_m: 0\.05 given"):
        read_shear_tests(Table(swapped))
    for key in ("inner_radius_m", "load_N"):
        with pytest.raises(TableError, match=f"column {key} is missing"):
            read_shear_tests(Table({k: v for k, v in ring.items() if k != key}))
    with pytest.raises(TableError, match=r"needs 2 or more samples .*; it has 1"):
        read_shear_tests(Table({k: v[:1] for k, v in ring.items()}))


def test_many_samples_of_a_shear_test_are_means_and_keep_the_steady_end():
    table = shear(stresses=(5e3,), repeats=1, points=100)
    j = table["shear_displacement_m"].copy()
    j[-1] = np.nan
    test = read_shear_tests(Table(table.columns | {"shear_displacement_m": j}))[0]
    assert len(test.displacement) <= 26 and np.isinf(test.displacement[-1])
    assert test.stress[-1] == table["shear_stress_Pa"][-1]
    step = np.nanmax(j) / 25
    own = (j >= 3 * step) & (j < 4 * step)
    near = np.argmin(np.abs(test.displacement[:-1] - j[own].mean()))
    assert test.displacement[near] == pytest.approx(j[own].mean())
    assert test.stress[near] == pytest.approx(table["shear_stress_Pa"][own].mean())
