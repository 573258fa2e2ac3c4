"""How readings scatter: planted noise, run-to-run soil and memory are found again."""

import numpy as np
import pytest
from gap_sets import bench_of, case_of, driven

from soilml.gap.data.observations import cells_of
from soilml.gap.statistics.coordinates import linearised
from soilml.gap.statistics.reml_covariance import (
    SCATTER,
    Scatter,
    assembled,
    estimated,
    scatter_columns,
)
from soilml.gap.statistics.smooth_basis import smooth_columns

LOADS = (40.0, 65.0, 100.0, 150.0) * 4


@pytest.fixture(scope="module")
def rig():
    """Sixteen runs, the columns of scatter, and what soil and smooth shapes could explain."""
    case = case_of()
    cells = cells_of(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    bench = bench_of(case, driven(case, loads=LOADS, slips=4, noise=0.0))
    soil = linearised(case, bench.soil, np.full(3, 0.4), cells)[1]
    columns = scatter_columns(case, cells)
    return cells, columns, np.column_stack([soil, smooth_columns(cells)])


def typical(rig, truth, draws=3):
    """What is estimated from residuals drawn from a scatter, typically."""
    cells, columns, space = rig
    root = np.linalg.cholesky(assembled(cells, columns, truth).matrix)
    rng = np.random.default_rng(11)
    found = [
        estimated(cells, columns, root @ rng.standard_normal(len(cells)), space).scatter
        for _ in range(draws)
    ]
    return {
        "scale": np.median([f.scale for f in found], axis=0),
        "angle": np.median([f.friction_angle for f in found]) / SCATTER["friction_angle"],
        "bearing": np.median([f.bearing for f in found]) / SCATTER["bearing"],
        "memory": np.median([f.memory for f in found]),
    }


def scatter(scale=1.0, angle=0.0, bearing=0.0, memory=0.0):
    return Scatter(
        np.full(3, scale),
        angle * SCATTER["friction_angle"],
        bearing * SCATTER["bearing"],
        memory,
        1.0,
    )


def test_readings_as_declared_are_believed(rig):
    found = typical(rig, scatter())
    assert np.all(found["scale"] < 1.2)
    assert found["angle"] <= 0.25 and found["bearing"] <= 0.25 and found["memory"] == 0.0


def test_soil_that_differs_from_run_to_run_is_found(rig):
    found = typical(rig, scatter(angle=1.2, bearing=1.2))
    assert 0.7 < found["angle"] < 1.9
    assert 0.7 < found["bearing"] < 1.9
    assert np.all(found["scale"] < 1.3)


def test_samples_that_remember_are_found(rig):
    assert typical(rig, scatter(memory=0.7))["memory"] in (0.5, 0.7, 0.85)


def test_noise_above_the_declared_is_found(rig):
    np.testing.assert_allclose(typical(rig, scatter(scale=1.8))["scale"], 1.8, rtol=0.25)


def test_noise_is_never_believed_smaller_than_declared(rig):
    found = typical(rig, scatter(scale=0.3))
    np.testing.assert_array_equal(found["scale"], 1.0)


def test_one_run_alone_tells_nothing_of_scatter_between_runs():
    case = case_of()
    cells = cells_of(case, driven(case, loads=(60.0,), slips=12))
    columns = scatter_columns(case, cells)
    residual = 3.0 * columns[:, 0]
    found = estimated(cells, columns, residual, smooth_columns(cells)).scatter
    assert found.friction_angle == 0.0 and found.bearing == 0.0


def test_the_covariance_is_noise_scatter_of_runs_and_memory(rig):
    cells, columns, _ = rig
    made = assembled(cells, columns, scatter(scale=2.0, angle=1.0, memory=0.5))
    np.testing.assert_allclose(
        made.whiten @ made.matrix @ made.whiten.T, np.eye(len(cells)), atol=1e-8
    )
    np.testing.assert_allclose(made.std, np.hypot(2.0 * cells.std, columns[:, 0]))
    run, channel = cells.run[cells.row], cells.channel
    assert np.all(made.matrix[run[:, None] != run] == 0.0)
    i, j = np.flatnonzero((run == 0) & (channel == 0))[:2]
    shared = 0.5 * 4.0 * cells.std[i] * cells.std[j] + columns[i, 0] * columns[j, 0]
    assert made.matrix[i, j] == pytest.approx(shared)


def test_the_columns_of_scatter_are_what_the_soil_does(rig):
    cells, columns, _ = rig
    case = case_of()
    phi = float(case.soil.friction_angle) + SCATTER["friction_angle"]
    more = linearised(case.with_values({"friction_angle": phi}), [], np.zeros(0), cells)[0]
    off = more - linearised(case, [], np.zeros(0), cells)[0]
    np.testing.assert_allclose(columns[:, 0], off, rtol=0.1, atol=0.05 * np.abs(off).max())
