"""Plate tests by their formulas, and the scatter from test to test."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter_tables import plates

from soilml.errors import TableError
from soilml.identification.bevameter import (
    bevameter,
    plate_tests,
)
from soilml.identification.bevameter.plate_tests import PlateTest, read_plate_tests
from soilml.identification.bevameter.scatter import (
    Scatter,
    distinct_levels,
    is_level,
    pooled_scatter,
    relative_line,
)
from soilml.io.table import Table


def test_levels_are_groups_of_values_within_three_per_cent():
    values = np.asarray([2.0, 1.0, 1.029, 2.0599, 1.058, 5.0])
    levels = distinct_levels(values)
    np.testing.assert_allclose(levels, [np.mean([1.0, 1.029, 1.058]), np.mean([2.0, 2.0599]), 5.0])
    found = is_level(np.asarray([1.0, 1.029, 1.031, 0.972, 0.970]), 1.0)
    assert found.tolist() == [True, True, False, True, False]


def test_a_line_of_relative_residuals_weights_small_readings_as_large_ones():
    x = np.asarray([1.0, 2.0, 10.0, 20.0])
    y = (2.0 + 3.0 * x) * np.asarray([1.02, 0.98, 1.03, 0.97])
    columns = np.stack([np.ones(4), x], axis=1)
    line, hat, fitted = relative_line(columns, y)
    np.testing.assert_allclose(fitted, columns @ line, rtol=1e-12)
    # the weights are those of the fit: the normal equations hold
    np.testing.assert_allclose((columns / fitted[:, None]).T @ (y / fitted - 1.0), 0.0, atol=1e-3)
    np.testing.assert_allclose(line, [2.0, 3.0], rtol=0.1)
    # derivatives by relative errors of the readings
    for i in range(4):
        moved = y * np.where(np.arange(4) == i, 1.0 + 1e-4, 1.0)
        change = (relative_line(columns, moved)[0] - line) / 1e-4
        np.testing.assert_allclose(hat[:, i], change, atol=0.15 * np.abs(hat).max())


def test_scatter_pools_what_is_usual_as_two_repeats():
    residuals = np.asarray([[0.2, 0.0], [-0.2, 0.1], [0.0, -0.1]])
    found = pooled_scatter(residuals, np.asarray([0.1, 0.3]), 1)
    assert found.degrees_of_freedom == 4.0
    expected = (2.0 * np.diag([0.01, 0.09]) + residuals.T @ residuals) / 4.0
    np.testing.assert_allclose(found.covariance, expected)
    alone = pooled_scatter(np.zeros((1, 2)), np.asarray([0.1, 0.3]), 2)
    assert alone.degrees_of_freedom == 2.0
    np.testing.assert_allclose(alone.covariance, np.diag([0.01, 0.09]))


def test_draws_follow_student_with_one_scale():
    covariance = np.asarray([[4.0, 1.5], [1.5, 1.0]])
    mean, other = Scatter(covariance, 10.0).draws(0.25 * covariance)
    assert mean.shape == other.shape and len(mean) == 20000
    # Student's t with 10 degrees of freedom has the variance 10 / 8
    np.testing.assert_allclose(np.cov(other.T), 1.25 * covariance, rtol=0.05)
    np.testing.assert_allclose(np.cov(mean.T), 1.25 * 0.25 * covariance, rtol=0.05)
    assert abs(np.corrcoef(mean[:, 0], other[:, 0])[0, 1]) < 0.03
    assert np.corrcoef(np.abs(mean[:, 0]), np.abs(other[:, 1]))[0, 1] > 0.05
    again = Scatter(covariance, 10.0).draws(0.25 * covariance)
    np.testing.assert_array_equal(again[0], mean)


def plate(z, p, name="a", size=0.05):
    return PlateTest(name, size, np.asarray(z), np.asarray(p), 0)


def test_one_plate_test_is_fitted_by_least_squares_with_squared_pressures():
    z = np.asarray([0.01, 0.02, 0.04, 0.08])
    p = 1e6 * z**0.8 * np.asarray([1.1, 0.95, 1.02, 0.99])
    depth = plate_tests._reference_depth([plate(z, p), plate(z, 7.0 * p)])
    assert depth == pytest.approx(np.exp(np.sum(p**2 * np.log(z)) / np.sum(p**2)))
    curve = plate_tests._fit_curve(plate(z, p), depth)
    x, y = np.log(z / depth), np.log(p)
    w = p**2 / np.sum(p**2)
    slope = np.sum(w * (x - w @ x) * y) / np.sum(w * (x - w @ x) ** 2)
    assert curve.exponent == pytest.approx(slope, rel=1e-9)
    assert curve.log_pressure == pytest.approx(w @ y - slope * (w @ x), rel=1e-9)
    off = p * (y - curve.log_pressure - slope * x)
    assert curve.misfit == pytest.approx(np.sqrt(np.sum(off**2) / np.sum(p**2)), rel=1e-9)


def test_halves_of_a_plate_test_are_those_of_its_logarithm_without_the_shallow_tenth():
    z = np.geomspace(0.001, 0.1, 41)
    bend = np.where(z < 0.01, 5.0, np.where(z < np.sqrt(0.001), 0.5, 1.5))
    log_p = np.append(0.0, np.cumsum(bend[1:] * np.diff(np.log(z))))
    halves = plate_tests._fit_curve(plate(z, 1e3 * np.exp(log_p)), 0.05).halves
    assert halves[0] == pytest.approx(0.5, abs=0.1) and halves[1] == pytest.approx(1.5, abs=0.02)
    # readings end far before the last one, whose tenth is the shallow part
    gap = np.append(z[z < 0.03], 0.1)
    log_p = np.interp(np.log(gap), np.log(z), log_p)
    halves = plate_tests._fit_curve(plate(gap, 1e3 * np.exp(log_p)), 0.05).halves
    assert np.isnan(halves).all()  # one reading in the deeper half
    beyond = np.append(gap, 0.1001)
    log_p = np.append(log_p, log_p[-1] + 1.5 * np.log(1.001))
    halves = plate_tests._fit_curve(plate(beyond, 1e3 * np.exp(log_p)), 0.05).halves
    assert halves[0] == pytest.approx(0.5, abs=0.1)
    few = plate_tests._fit_curve(plate([0.02, 0.03, 0.1], [1.0, 2.0, 3.0]), 0.05)
    assert np.isnan(few.halves).all() and few.exponent > 0.0  # one point in the deeper half
    curves = [replace(few, halves=h) for h in ((0.4, 1.0), (0.6, 1.4), (np.nan, np.nan))]
    assert plate_tests._exponent_span(curves, 0.9) == pytest.approx((0.5, 1.2))
    assert plate_tests._exponent_span(curves, 1.5) == pytest.approx((0.5, 1.5))
    assert plate_tests._exponent_span(curves[2:], 0.9) == (0.9, 0.9)


def test_moduli_and_pressures_of_a_fit_belong_together():
    fit = bevameter(plates(scatter=(0.1, 0.02))).plates
    kc, kphi = fit.moduli
    for b in (0.05, 0.08):
        pressure = fit.pressure_at_depth(b)
        assert pressure.value == pytest.approx((kc / b + kphi) * fit.depth**fit.exponent)
        assert fit.modulus(b).value == pytest.approx(kc / b + kphi)
        assert pressure.mean_95[0] < pressure.value < pressure.mean_95[1]
        low, high = fit.modulus(b).another_place_95
        assert low < fit.modulus(b).value < high
        assert pressure.another_place_95[0] < pressure.mean_95[0]
        draws = fit.mean_draws
        k = (draws[:, 0] + draws[:, 1] / b) * fit.depth ** -draws[:, 2]
        assert fit.modulus(b).mean_95 == pytest.approx(np.quantile(k, [0.025, 0.975]))
    kphi_draws = fit.place_draws[:, 0] * fit.depth ** -fit.place_draws[:, 2]
    found = fit.estimates()["kphi"].another_place_95
    assert found == pytest.approx(np.quantile(kphi_draws, [0.025, 0.975]))
    assert fit.several_sizes and not bevameter(plates(sizes=(0.05, 0.0545))).plates.several_sizes
    assert bevameter(plates(sizes=(0.05, 0.0555))).plates.several_sizes


def test_many_samples_of_a_plate_are_means_over_steps_of_sinkage():
    table = plates(sizes=(0.05,), repeats=1, points=100)
    test = read_plate_tests(table)[0]
    assert len(test.sinkage) <= 25 and test.size == 0.05 and test.omitted == 0
    z, p = table["sinkage_m"], table["pressure_Pa"]
    steps = [
        z[(z > low) & (z <= low + z[-1] / 25 * (1 + 1e-12))] for low in z[-1] / 25 * np.arange(25)
    ]
    np.testing.assert_allclose(test.sinkage, [s.mean() for s in steps if s.size], rtol=0.03)
    assert test.sinkage[-1] <= z[-1] and test.pressure[0] < test.pressure[-1] <= p[-1]
    exact = read_plate_tests(plates(sizes=(0.05,), repeats=1, points=25))[0]
    np.testing.assert_array_equal(exact.sinkage, np.linspace(0.005, 0.08, 25))


def test_plates_of_two_sizes_are_not_one_test():
    columns = plates(sizes=(0.05,), repeats=1).columns
    size = columns["plate_radius_m"]
    read_plate_tests(Table(columns | {"plate_radius_m": size * np.linspace(1.0, 1.009, len(size))}))
    with pytest.raises(TableError, match=r"0\.05 and 0\.0506 m; give each plate a test of its own"):
        other = size * np.linspace(1.0, 1.012, len(size))
        read_plate_tests(Table(columns | {"plate_radius_m": other}))
    few = {k: v[:2] for k, v in columns.items()}
    with pytest.raises(TableError, match=r"needs 3 or more samples .* it has 2"):
        read_plate_tests(Table(few))
    assert len(read_plate_tests(Table({k: v[:3] for k, v in columns.items()}))) == 1
    with pytest.raises(TableError, match="the table has no row"):
        read_plate_tests(Table({k: v[:0] for k, v in columns.items()}))
