"""Curves, lines and scatter of plate and shear tests, by their formulas; JSON and pictures."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, K, N, plates, shear

from soilml.errors import TableError
from soilml.identification.bevameter import (
    bevameter,
    pressure_sinkage,
    shear_strength,
    soil_section,
)
from soilml.identification.bevameter.estimate import (
    SpreadEstimate,
    distinct_levels,
    is_level,
    spread_estimate,
)
from soilml.identification.bevameter.plate_tests import PlateTest, read_plate_tests
from soilml.identification.bevameter.plot import save_picture
from soilml.identification.bevameter.relative_line import relative_line
from soilml.identification.bevameter.remarks import plate_remarks, shear_remarks
from soilml.identification.bevameter.scatter import Scatter, pooled_scatter
from soilml.identification.bevameter.shear_tests import ShearTest, read_shear_tests
from soilml.io.table import Table


def test_levels_are_groups_of_values_within_three_per_cent():
    values = np.asarray([2.0, 1.0, 1.029, 2.0599, 1.058, 5.0])
    levels = distinct_levels(values)
    np.testing.assert_allclose(levels, [np.mean([1.0, 1.029, 1.058]), np.mean([2.0, 2.0599]), 5.0])
    found = is_level(np.asarray([1.0, 1.029, 1.031, 0.972, 0.970]), 1.0)
    assert found.tolist() == [True, True, False, True, False]


def test_a_spread_is_that_of_the_middle_nineteen_of_twenty_draws():
    draws = np.linspace(0.0, 1.0, 1001)
    found = spread_estimate(0.4, draws, 10.0 * draws, "Pa")
    assert found.mean_range == pytest.approx((0.025, 0.975))
    assert found.place_range == pytest.approx((0.25, 9.75))
    assert found.as_json() == {
        "value": 0.4,
        "mean_95": list(found.mean_range),
        "another_place_95": list(found.place_range),
        "unit": "Pa",
    }
    within = shear_strength._with(found, [-0.1, 5.0])
    assert within.mean_range == (-0.1, 5.0) and within.value == 0.4
    assert within.place_range == pytest.approx((-0.1, 9.75))
    assert shear_strength._with(found, []) == found


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
    depth = pressure_sinkage._reference_depth([plate(z, p), plate(z, 7.0 * p)])
    assert depth == pytest.approx(np.exp(np.sum(p**2 * np.log(z)) / np.sum(p**2)))
    curve = pressure_sinkage._fit_curve(plate(z, p), depth)
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
    halves = pressure_sinkage._fit_curve(plate(z, 1e3 * np.exp(log_p)), 0.05).halves
    assert halves[0] == pytest.approx(0.5, abs=0.1) and halves[1] == pytest.approx(1.5, abs=0.02)
    few = pressure_sinkage._fit_curve(plate([0.02, 0.03, 0.1], [1.0, 2.0, 3.0]), 0.05)
    assert np.isnan(few.halves).all() and few.exponent > 0.0  # one point in the deeper half
    curves = [replace(few, halves=h) for h in ((0.4, 1.0), (0.6, 1.4), (np.nan, np.nan))]
    assert pressure_sinkage._exponent_span(curves, 0.9) == pytest.approx((0.5, 1.2))
    assert pressure_sinkage._exponent_span(curves, 1.5) == pytest.approx((0.5, 1.5))
    assert pressure_sinkage._exponent_span(curves[2:], 0.9) == (0.9, 0.9)


def test_moduli_and_pressures_of_a_fit_belong_together():
    fit = bevameter(plates(scatter=(0.1, 0.02))).plates
    kc, kphi = fit.moduli
    for b in (0.05, 0.08):
        pressure = fit.pressure_at_depth(b)
        assert pressure.value == pytest.approx((kc / b + kphi) * fit.depth**fit.exponent)
        assert fit.modulus(b).value == pytest.approx(kc / b + kphi)
        assert pressure.mean_range[0] < pressure.value < pressure.mean_range[1]
        low, high = fit.modulus(b).place_range
        assert low < fit.modulus(b).value < high
        assert pressure.place_range[0] < pressure.mean_range[0]
        draws = fit.mean_draws
        k = (draws[:, 0] + draws[:, 1] / b) * fit.depth ** -draws[:, 2]
        assert fit.modulus(b).mean_range == pytest.approx(np.quantile(k, [0.025, 0.975]))
    kphi_draws = fit.place_draws[:, 0] * fit.depth ** -fit.place_draws[:, 2]
    found = fit.estimates()["kphi"].place_range
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


def curve(j, stress, sigma=10e3, variation=0.0, name="a"):
    return ShearTest(name, sigma, np.asarray(j), np.asarray(stress), variation)


def test_a_shear_curve_gives_strength_and_modulus_and_its_shape():
    j = np.linspace(0.002, 0.05, 21)
    exact = shear_strength.fit_shear_curve(curve(j, 5e3 * -np.expm1(-j / 0.01)))
    assert exact.strength == pytest.approx(5e3, rel=2e-3)
    assert exact.modulus == pytest.approx(0.01, rel=0.01)
    assert exact.mobilised == pytest.approx(-np.expm1(-0.05 / exact.modulus), rel=1e-9)
    assert exact.peak == pytest.approx(5e3 * -np.expm1(-5.0))
    late = 5e3 * -np.expm1(-j[j >= 0.8 * 0.05] / 0.01)
    assert exact.end == pytest.approx(late.mean(), rel=1e-9)
    assert exact.misfit < 1e-3
    # a steady end is a point at an infinite displacement
    steady = np.append(j, np.inf), np.append(5e3 * -np.expm1(-j / 0.01), 4.5e3)
    found = shear_strength.fit_shear_curve(curve(*steady))
    assert found.end == 4.5e3 and found.mobilised == 1.0 and found.strength < 5e3
    off = steady[1] - found.strength * -np.expm1(-steady[0] / found.modulus)
    misfit = np.sqrt(np.sum(off**2) / np.sum(steady[1] ** 2))
    assert found.misfit == pytest.approx(misfit, rel=1e-9)
    # a straight line has no modulus below twice its length
    straight = shear_strength.fit_shear_curve(curve(j, 1e5 * j))
    assert straight.modulus == pytest.approx(0.1, rel=0.011)


def test_shape_factors_run_from_the_end_of_the_curves_to_their_peak():
    base = shear_strength.ShearCurve(100.0, 0.01, 100.0, 100.0, 1.0, 0.0)
    assert shear_strength._shape_factors([base], 3).tolist() == [1.0, 1.0, 1.0]
    bent = [replace(base, peak=121.0, end=81.0), base]
    np.testing.assert_allclose(shear_strength._shape_factors(bent, 3)[[0, 2]], [0.9, 1.1])
    rising = replace(base, peak=100.0, end=100.0, mobilised=0.5)
    np.testing.assert_allclose(shear_strength._shape_factors([rising], 2), [1.0, 2.0])


def test_halves_of_a_failure_line_are_found_where_a_parabola_is_needed():
    sigma = np.linspace(2e3, 20e3, 7)
    jitter = 1.0 + 0.005 * np.asarray([1, -1, 1, -1, 1, -1, 1])
    assert shear_strength._halves(sigma, (800.0 + 0.7 * sigma) * jitter) == ()
    middle = np.median(sigma)
    bent = 500.0 + 0.8 * np.minimum(sigma, middle) + 0.4 * np.maximum(sigma - middle, 0.0)
    (c0, phi0), (c1, phi1) = shear_strength._halves(sigma, bent)
    assert (c0, c1) == pytest.approx((500.0, 500.0 + 0.4 * middle))
    assert np.tan([phi0, phi1]) == pytest.approx([0.8, 0.4])
    falling = 9e3 + 0.8 * np.minimum(sigma, middle) - 0.4 * np.maximum(sigma - middle, 0.0)
    assert shear_strength._halves(sigma, falling)[1][1] == 0.0
    assert shear_strength._halves(sigma[:4], 800.0 + 0.7 * sigma[:4]) == ()


def test_a_trend_is_reported_where_it_is_three_standard_errors():
    x = np.linspace(0.0, 1.0, 6)
    noise = 0.1 * np.asarray([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])
    slope, residuals, *_ = np.polyfit(x, noise, 1, full=True)
    std = np.sqrt(residuals[0] / 4.0 / np.sum((x - x.mean()) ** 2))
    for times, reported in ((2.9, False), (3.1, True), (-3.1, True), (-2.9, False)):
        wanted = times * std
        found = shear_strength._trend(5.0 + x, 2.0 + noise + (wanted - slope[0]) * x)
        assert found == (pytest.approx(wanted) if reported else 0.0)


def test_a_failure_line_has_relative_scatter_and_goes_above_zero():
    found = bevameter(shear=shear(scatter=0.1)).shear
    at = found.cohesion.value + np.mean([5e3, 10e3, 20e3]) * np.tan(found.friction_angle.value)
    assert found.strength.value == pytest.approx(at, rel=1e-9)
    assert found.shear_modulus.value == pytest.approx(K, rel=0.01)
    assert found.cohesion.mean_range[0] >= 0.0
    low, high = found.strength.place_range
    assert low < found.strength.mean_range[0] < at < found.strength.mean_range[1] < high
    assert found.halves == () and found.modulus_trend == 0.0
    table = shear(stresses=(2e3, 5e3, 10e3, 20e3), repeats=1)
    j = table["shear_displacement_m"]
    modulus = K * (table["normal_stress_Pa"] / 5e3) ** 0.5
    tau = (C + table["normal_stress_Pa"] * np.tan(PHI)) * -np.expm1(-j / modulus)
    grown = bevameter(shear=Table(table.columns | {"shear_stress_Pa": tau}))
    assert grown.shear.modulus_trend == pytest.approx(0.5, abs=0.03)
    assert any("K grows with the normal stress: 7.6 to 24 mm" in text for text in grown.remarks)
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
    for key in ("inner_radius_m", "angle_rad", "load_N"):
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


def test_priors_of_a_soil_contain_its_value_and_keep_the_bounds():
    prior = soil_section._prior
    wide = prior("kphi", 1e6, (4e5, 2e6))
    assert (wide.lower, wide.upper, wide.log) == (4e5, 2e6, True)
    assert not prior("kphi", 1e6, (7e5, 2e6)).log  # less than a factor of three
    assert not prior("cohesion", 1e3, (0.0, 2e3)).log
    narrow = prior("n", 1.0, (1.0, 1.0))
    assert (narrow.lower, narrow.upper) == pytest.approx((0.999, 1.001))
    assert prior("cohesion", 10.0, (-50.0, 100.0)).lower == 0.0
    assert prior("friction_angle", 0.5, (0.1, 9.0)).upper == 1.4
    outside = prior("friction_angle", 2.0, (1.9, 2.1))
    assert outside.lower < outside.upper
    assert soil_section.within_bounds({"n": 9.0, "kc": 1.0, "cohesion": -2.0}) == {
        "n": 3.0,
        "kc": 1.0,
        "cohesion": 0.0,
    }


def test_remarks_name_what_stands_in_the_fits():
    fit = bevameter(plates(repeats=3, scatter=(0.2, 0.05))).plates
    said = list(plate_remarks(fit))
    pressures = [np.exp(c.log_pressure) for t, c in zip(fit.tests, fit.curves, strict=True)]
    first = max(pressures[:3]) / min(pressures[:3])
    assert any(
        f"3 tests with the plate of 0.05 m differ by a factor {first:.2f}" in t for t in said
    )
    assert any("they hold down to 0.08 m, the deepest test" in text for text in said)
    assert not any("no plate test was repeated" in text for text in said)
    once = list(plate_remarks(bevameter(plates(repeats=1)).plates))
    assert any("no plate test was repeated" in text for text in once)
    assert not any("differ by a factor" in text for text in once)
    negative = list(plate_remarks(bevameter(plates(kc=-2e4, repeats=4)).plates))
    assert any(t.startswith(("kc is below zero", "kc may be below")) for t in negative)
    fit = bevameter(shear=shear(repeats=2, scatter=0.1)).shear
    said = list(shear_remarks(fit))
    strengths = [c.strength for c in fit.curves[:2]]
    ratio = max(strengths) / min(strengths)
    assert any(f"2 tests at 5 kPa differ by a factor {ratio:.2f} in strength" in t for t in said)
    assert not any("no shear test was repeated" in text for text in said)
    assert not any("normal stress varies" in text for text in said)
    tests = [replace(t, normal_variation=0.051) for t in fit.tests]
    varied = list(shear_remarks(replace(fit, tests=tuple(tests))))
    names = ", ".join(t.name for t in tests[:4])
    assert any(f"within {names} and 2 more; its mean is used" in text for text in varied)
    poor = [replace(c, misfit=0.11 if i < 4 else 0.09) for i, c in enumerate(fit.curves)]
    said = list(shear_remarks(replace(fit, curves=tuple(poor))))
    wanted = ", ".join(f"{t.name} (11%)" for t in fit.tests[:4])
    assert f"the law fits poorly, by its relative residual: {wanted}" in said
    peaks = [replace(c, peak=1.11 * c.end) for c in fit.curves]
    assert any("passes a peak" in t for t in shear_remarks(replace(fit, curves=tuple(peaks))))
    peaks = [replace(c, peak=1.09 * c.end) for c in fit.curves]
    assert not any("passes a peak" in t for t in shear_remarks(replace(fit, curves=tuple(peaks))))
    for change in ({"mobilised": 0.89}, {"end": 1.06 * fit.curves[0].strength, "mobilised": 1.0}):
        rising = (replace(fit.curves[0], **change), *fit.curves[1:])
        said = list(shear_remarks(replace(fit, curves=rising)))
        assert any(f"still rises at the end of {fit.tests[0].name}:" in t for t in said)


def test_json_of_the_result_holds_every_test():
    found = bevameter(plates(repeats=1), shear(repeats=1))
    content = found.as_json()
    assert set(content["estimates"]) == {*("n", "kc", "kphi"), *("cohesion", "friction_angle")} | {
        "shear_modulus"
    }
    entry = content["plate_tests"][1]
    assert (entry["test"], entry["plate_m"]) == ("0.1_0", 0.1)
    assert entry["n"] == pytest.approx(N, rel=1e-3)
    assert entry["k"] == pytest.approx(KC / 0.1 + KPHI, rel=1e-3) and entry["misfit"] < 1e-6
    entry = content["shear_tests"][2]
    assert (entry["test"], entry["normal_stress_Pa"]) == ("20000_0", 20e3)
    assert entry["strength_Pa"] == pytest.approx(C + 20e3 * np.tan(PHI), rel=0.01)
    assert entry["shear_modulus_m"] == pytest.approx(K, rel=0.02)
    assert content["soil"] == found.soil and content["remarks"] == list(found.remarks)
    assert bevameter(plates()).as_json()["shear_tests"] == []
    assert bevameter(shear=shear()).as_json()["plate_tests"] == []
    assert isinstance(found.estimates()["n"], SpreadEstimate)


@pytest.mark.parametrize(("kinds", "panels"), [("plates", 1), ("shear", 2), ("both", 3)])
def test_a_picture_shows_tests_curves_and_laws(tmp_path, monkeypatch, kinds, panels):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    drawn = []
    monkeypatch.setattr(pyplot, "close", drawn.append)
    found = bevameter(
        None if kinds == "shear" else plates(repeats=1), None if kinds == "plates" else shear()
    )
    save_picture(tmp_path / "soil.png", found)
    monkeypatch.undo()
    axes = drawn[0].axes
    pyplot.close(drawn[0])
    assert (tmp_path / "soil.png").read_bytes().startswith(b"\x89PNG") and len(axes) == panels
    assert list(drawn[0].get_size_inches()) == pytest.approx([4.6 * panels, 3.9])
    lines = {a.get_ylabel(): [line.get_data() for line in a.lines] for a in axes}
    legends = {a.get_ylabel(): a.get_legend() is not None for a in axes}
    assert all(legends.values())
    if kinds != "shear":
        (z, p), (_, own), *_, (depth, law) = lines["pressure, kPa"]
        test = found.plates.tests[0]
        np.testing.assert_allclose(z, 1e3 * test.sinkage)  # mm
        np.testing.assert_allclose(p, 1e-3 * test.pressure)  # kPa
        np.testing.assert_allclose(own, p, rtol=1e-6)
        assert (depth[0], depth[-1]) == pytest.approx((5.0, 80.0))
        expected = (KC / 0.1 + KPHI) * (1e-3 * depth) ** N
        np.testing.assert_allclose(law, 1e-3 * expected, rtol=1e-3)
    if kinds != "plates":
        (j, tau), (grid, own), *_ = lines["shear stress, kPa"]
        np.testing.assert_allclose(j, np.linspace(2.0, 80.0, 15))
        np.testing.assert_allclose(np.interp(j, grid, own), tau, rtol=5e-3)
        assert grid[0] == 0.0 and grid[-1] == pytest.approx(80.0) and own[0] == 0.0
        (sigma, strength), (grid, line) = lines["shear strength, kPa"]
        np.testing.assert_allclose(sigma, [5.0, 5.0, 10.0, 10.0, 20.0, 20.0])
        np.testing.assert_allclose(np.interp(sigma, grid, line), strength, rtol=1e-3)
        assert (grid[0], grid[-1]) == pytest.approx((0.0, 21.0))
        limits = next(a for a in axes if a.get_ylabel() == "shear strength, kPa")
        assert limits.get_xlim()[0] == limits.get_ylim()[0] == 0.0


def test_a_legend_of_many_tests_is_left_out(tmp_path, monkeypatch):
    from matplotlib import pyplot

    drawn = []
    monkeypatch.setattr(pyplot, "close", drawn.append)
    for repeats in (3, 4):  # six and eight tests
        save_picture(tmp_path / "soil.png", bevameter(plates(repeats=repeats)))
    monkeypatch.undo()
    assert [figure.axes[0].get_legend() is not None for figure in drawn] == [True, False]
    for figure in drawn:
        pyplot.close(figure)
