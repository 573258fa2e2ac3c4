"""Covariance: planted noise, run-to-run variation and autocorrelation are recovered."""

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.gap.data.stacked_readings import stack_readings
from soilml.gap.statistics.coordinates import linearise
from soilml.gap.statistics.reml_covariance import (
    RUN_EFFECT_UNITS,
    VarianceComponents,
    assemble_covariance,
    estimate_covariance,
    run_effect_columns,
)
from soilml.gap.statistics.smooth_basis import smooth_basis

LOADS = (40.0, 65.0, 100.0, 150.0) * 4


@pytest.fixture(scope="module")
def rig():
    """Sixteen runs, the columns of scatter, and what soil and smooth shapes could explain."""
    case = case_of()
    readings = stack_readings(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    problem = fit_problem(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    soil = linearise(case, problem.soil, np.full(3, 0.4), readings)[1]
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
    more = linearise(case.with_values({"friction_angle": phi}), [], np.zeros(0), readings)[0]
    off = more - linearise(case, [], np.zeros(0), readings)[0]
    np.testing.assert_allclose(columns[:, 0], off, rtol=0.1, atol=0.05 * np.abs(off).max())
