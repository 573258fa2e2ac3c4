"""Covariance: planted noise, run-to-run variation and autocorrelation are recovered."""

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.fitting.predictions import linearise, predict
from soilml.fitting.readings import stack_readings
from soilml.gap.evidence.covariance import (
    LOG_NOISE_SCALE_PRIOR_STD,
    RUN_EFFECT_GRID,
    RUN_EFFECT_PRIOR_STD,
    RUN_EFFECT_UNITS,
    VarianceComponents,
    _run_effect_grid,
    assemble_covariance,
    estimate_covariance,
    restricted_likelihood,
    run_effect_columns,
    whiten_series,
)
from soilml.gap.evidence.directions import smooth_basis

LOADS = (40.0, 65.0, 100.0, 150.0) * 4


@pytest.fixture(scope="module")
def rig():
    """Sixteen runs, the columns of scatter, and what soil and smooth shapes could explain."""
    case = case_of()
    readings = stack_readings(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    problem = fit_problem(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    soil = linearise(case, problem.soil, np.full(3, 0.4), readings).jacobian
    columns = run_effect_columns(case, readings)
    return readings, columns, np.column_stack([soil, smooth_basis(readings)])


def typical(rig, truth, draws=3):
    """What is estimated from residuals drawn from a scatter, typically."""
    readings, columns, space = rig
    root = np.linalg.cholesky(assemble_covariance(readings, columns, truth).matrix)
    rng = np.random.default_rng(11)
    found = [
        estimate_covariance(
            readings, columns, root @ rng.standard_normal(len(readings)), space
        ).components
        for _ in range(draws)
    ]
    units = RUN_EFFECT_UNITS
    return {
        "scale": np.median([f.noise_scale for f in found], axis=0),
        "angle": np.median([f.friction_angle_std for f in found]) / units["friction_angle"],
        "bearing": np.median([f.bearing_std for f in found]) / units["bearing"],
        "autocorrelation": np.median([f.autocorrelation for f in found]),
    }


def scatter(scale=1.0, angle=0.0, bearing=0.0, autocorrelation=0.0):
    return VarianceComponents(
        np.full(3, scale),
        angle * RUN_EFFECT_UNITS["friction_angle"],
        bearing * RUN_EFFECT_UNITS["bearing"],
        autocorrelation,
        1.0,
    )


def test_declared_noise_is_confirmed(rig):
    found = typical(rig, scatter())
    assert np.all(found["scale"] < 1.2)
    assert found["angle"] <= 0.25 and found["bearing"] <= 0.25 and found["autocorrelation"] == 0.0


@pytest.mark.slow
def test_run_to_run_variation_is_estimated(rig):
    found = typical(rig, scatter(angle=1.2, bearing=1.2))
    assert 0.7 < found["angle"] < 1.9
    assert 0.7 < found["bearing"] < 1.9
    assert np.all(found["scale"] < 1.3)


@pytest.mark.slow
def test_autocorrelation_is_estimated(rig):
    assert typical(rig, scatter(autocorrelation=0.7))["autocorrelation"] in (0.5, 0.7, 0.85)


def test_noise_above_the_declared_is_estimated(rig):
    np.testing.assert_allclose(typical(rig, scatter(scale=1.8))["scale"], 1.8, rtol=0.25)


def test_the_noise_scale_is_at_least_one(rig):
    found = typical(rig, scatter(scale=0.3))
    np.testing.assert_array_equal(found["scale"], 1.0)


def test_one_run_gives_no_run_to_run_variation():
    case = case_of()
    readings = stack_readings(case, driven(case, loads=(60.0,), slips=12))
    columns = run_effect_columns(case, readings)
    residual = 3.0 * columns[:, 0]
    found = estimate_covariance(readings, columns, residual, smooth_basis(readings)).components
    assert found.friction_angle_std == 0.0 and found.bearing_std == 0.0


def test_the_covariance_has_noise_run_effects_and_autocorrelation(rig):
    readings, columns, _ = rig
    made = assemble_covariance(
        readings, columns, scatter(scale=2.0, angle=1.0, autocorrelation=0.5)
    )
    np.testing.assert_allclose(
        made.whiten @ made.matrix @ made.whiten.T, np.eye(len(readings)), atol=1e-8
    )
    np.testing.assert_allclose(made.std, np.hypot(2.0 * readings.std, columns[:, 0]))
    run, channel = readings.run[readings.row], readings.channel
    assert np.all(made.matrix[run[:, None] != run] == 0.0)
    i, j = np.flatnonzero((run == 0) & (channel == 0))[:2]
    shared = 0.5 * 4.0 * readings.std[i] * readings.std[j] + columns[i, 0] * columns[j, 0]
    assert made.matrix[i, j] == pytest.approx(shared)


def test_run_effect_columns_agree_with_the_model(rig):
    readings, columns, _ = rig
    case = case_of()
    phi = float(case.soil.friction_angle) + RUN_EFFECT_UNITS["friction_angle"]
    more = predict(case.with_values({"friction_angle": phi}), [], np.zeros((1, 0)), readings)[0]
    off = more - predict(case, [], np.zeros((1, 0)), readings)[0]
    np.testing.assert_allclose(columns[:, 0], off, rtol=0.1, atol=0.05 * np.abs(off).max())


def dense_objective(readings, columns, residual, basis, components):
    """-2 log posterior, from the covariance of all readings."""
    matrix = assemble_covariance(readings, columns, components).matrix
    inverse = np.linalg.inv(matrix)
    information = basis.T @ inverse @ basis
    weights = np.linalg.solve(information, basis.T @ inverse @ residual)
    left = residual - basis @ weights
    units = (RUN_EFFECT_UNITS["friction_angle"], RUN_EFFECT_UNITS["bearing"])
    tau = np.asarray([components.friction_angle_std, components.bearing_std]) / units
    return (
        np.linalg.slogdet(matrix)[1]
        + np.linalg.slogdet(information)[1]
        + left @ inverse @ left
        + np.sum((np.log(components.noise_scale) / LOG_NOISE_SCALE_PRIOR_STD) ** 2)
        + np.sum((tau / RUN_EFFECT_PRIOR_STD) ** 2)
    )


@pytest.mark.parametrize("autocorrelation", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("angle, bearing", [(0.0, 0.0), (1.2, 0.0), (0.5, 5.0)])
def test_sums_by_run_give_the_likelihood_of_the_full_covariance(
    rig,
    autocorrelation,
    angle,
    bearing,
):
    readings, columns, space = rig
    kept = np.arange(len(readings)) % 7 != 3  # series with gaps
    readings, columns, space = readings.subset(kept), columns[kept], space[kept]
    residual = np.random.default_rng(2).standard_normal(len(readings)) * readings.std
    scales = np.asarray([[1.0, 1.0, 1.0], [1.3, 1.0, 2.0]])
    found = restricted_likelihood(readings, columns, residual, space, autocorrelation).objective(
        scales, np.tile([angle, bearing], (2, 1))
    )
    for value, scale in zip(found, scales, strict=True):
        components = scatter(scale, angle, bearing, autocorrelation)
        dense = dense_objective(readings, columns, residual, space, components)
        assert value == pytest.approx(dense, rel=1e-8, abs=1e-6)


def test_a_series_is_whitened_by_the_sample_before(rig):
    readings, columns, _ = rig
    white, log_determinant = whiten_series(readings, np.eye(len(readings)), 0.7)
    components = scatter(1.0, 0.0, 0.0, 0.7)
    covariance = assemble_covariance(readings, columns, components).matrix
    correlation = covariance / np.outer(readings.std, readings.std)
    np.testing.assert_allclose(white @ correlation @ white.T, np.eye(len(readings)), atol=1e-12)
    assert log_determinant == pytest.approx(np.linalg.slogdet(correlation)[1])


def test_residuals_within_the_fixed_effects_leave_nothing(rig):
    readings, columns, space = rig
    weights = np.linspace(0.5, 1.0, space.shape[1])
    likelihood = restricted_likelihood(readings, columns, space @ weights, space, 0.0)
    nothing = restricted_likelihood(readings, columns, 0.0 * readings.std, space, 0.0)
    one, none = np.ones((1, 3)), np.zeros((1, 2))
    assert likelihood.objective(one, none) == pytest.approx(nothing.objective(one, none))


def test_whitening_by_run_inverts_the_covariance(rig):
    readings, columns, _ = rig
    covariance = assemble_covariance(readings, columns, scatter(1.2, 0.8, 0.5, 0.5))
    dense = np.linalg.inv(np.linalg.cholesky(covariance.matrix))
    np.testing.assert_allclose(covariance.whiten, dense, rtol=1e-9, atol=1e-9 * dense.max())


def test_runs_of_one_sample_have_no_neighbours():
    case = case_of()
    table = driven(case, loads=LOADS[:4], slips=1)
    readings = stack_readings(case, table)
    white, log_determinant = whiten_series(readings, np.eye(len(readings)), 0.9)
    assert np.array_equal(white, np.eye(len(readings))) and log_determinant == 0.0


def test_bearing_varies_by_the_moduli_that_the_soil_has(rig):
    """Without kc, or with one of 1, five per cent of bearing are five per cent of the moduli."""
    readings, _, _ = rig
    for kc in (0.0, 1.0):
        case = case_of().with_values({"kc": kc})
        found = run_effect_columns(case, readings)[:, 1]
        kphi = 1.05 * float(case.soil.kphi)
        more = case.with_values({"kc": 1.05 * kc, "kphi": kphi})
        off = predict(more, [], np.zeros((1, 0)), readings)[0]
        off = off - predict(case, [], np.zeros((1, 0)), readings)[0]
        np.testing.assert_allclose(found, off, rtol=0.1, atol=0.05 * np.abs(off).max())


@pytest.mark.parametrize("angle, bearing", [(2.0, 0.0), (0.0, 2.0)])
def test_friction_angle_and_bearing_are_told_apart(rig, angle, bearing):
    """Residuals of effects of plus and minus two units, which leave the span of noise alone."""
    readings, columns, _ = rig
    sign = np.where(readings.run[readings.row] % 2 == 0, 1.0, -1.0)
    rng = np.random.default_rng(5)
    residual = sign * (columns @ [angle, bearing]) + rng.standard_normal(len(sign)) * readings.std
    space = np.zeros((len(sign), 0))
    found = estimate_covariance(readings, columns, residual, space).components
    stds = found.friction_angle_std / np.deg2rad(0.5), found.bearing_std / 0.05
    assert stds[0 if angle else 1] in (1.2, 1.8, 3.0) and stds[1 if angle else 0] <= 0.5
    assert found.degrees_of_freedom == len(sign)


def test_a_few_readings_know_the_noise_as_well_as_its_prior_does(rig):
    """The scatter of its logarithm from so many normal residuals is that of the prior."""
    readings, columns, _ = rig
    everything = np.diag(readings.std)
    nothing_left = np.zeros(len(readings))
    found = estimate_covariance(readings, columns, nothing_left, everything).components
    count = found.degrees_of_freedom
    scale = np.sqrt(np.random.default_rng(3).chisquare(count, 100_000) / count)
    assert np.std(np.log(scale)) == pytest.approx(LOG_NOISE_SCALE_PRIOR_STD, rel=0.15)


def test_the_covariance_of_some_readings_is_their_part(rig):
    readings, columns, _ = rig
    truth = VarianceComponents(np.asarray([1.0, 2.0, 0.5]), 0.02, 0.1, 0.3, 9.0)
    whole = assemble_covariance(readings, columns, truth)
    chosen = readings.slip > np.median(readings.slip)
    part = whole.of_readings(chosen, readings.run[readings.row])
    np.testing.assert_array_equal(part.matrix, whole.matrix[chosen][:, chosen])
    assert part.components == truth
    inverse = part.whiten.T @ part.whiten
    np.testing.assert_allclose(inverse @ part.matrix, np.eye(chosen.sum()), atol=1e-8)


def test_the_scatter_from_run_to_run_that_is_tried_follows_the_number_of_runs():
    assert _run_effect_grid(1) == (0.0,)
    for few in (2, 5):
        assert _run_effect_grid(few) == (0.8, 1.2, 1.8, 3.0, 5.0)
    assert _run_effect_grid(6) == RUN_EFFECT_GRID == (0.0, 0.25, 0.5, 0.8, 1.2, 1.8, 3.0, 5.0)
