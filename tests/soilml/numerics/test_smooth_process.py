"""Columns of a smooth process: their products against the covariance itself."""

import numpy as np
import pytest

from soilml.numerics.smooth_process import (
    MOST_CENTRES,
    independent_bound,
    process_columns,
    slip_load_points,
)


def covariance(points, amplitude):
    square = ((points[:, None, :] - points) ** 2).sum(axis=-1)
    return np.outer(amplitude, amplitude) * np.exp(-0.5 * square)


def test_products_of_the_columns_are_the_covariance():
    rng = np.random.default_rng(1)
    slip, load = rng.uniform(-0.3, 0.8, 50), np.repeat([20.0, 40.0], 25)
    points = slip_load_points(slip, load, 0.3, 0.6)
    amplitude = rng.uniform(0.5, 2.0, 50)
    columns = process_columns(points, amplitude)
    assert columns.shape[1] < 50
    assert columns @ columns.T == pytest.approx(covariance(points, amplitude), abs=1e-4)


def test_many_points_are_represented_by_few():
    rng = np.random.default_rng(2)
    points = slip_load_points(rng.uniform(0, 0.8, 400), rng.uniform(20, 80, 400), 0.3, 0.6)
    columns = process_columns(points)
    assert columns.shape[1] <= MOST_CENTRES
    assert np.abs(columns @ columns.T - covariance(points, np.ones(400))).max() < 1e-3


def test_independent_errors_are_no_smaller_than_the_process_in_any_combination():
    points = np.random.default_rng(4).uniform(0.0, 3.0, (30, 2))
    difference = np.diag(independent_bound(process_columns(points))) - covariance(
        points, np.ones(30)
    )
    assert np.linalg.eigvalsh(difference).min() > -1e-4  # what the columns leave out
    assert independent_bound(process_columns(np.asarray([[0.0], [9.0]]))) == pytest.approx(1.0)
    assert independent_bound(process_columns(np.zeros((5, 1)))) == pytest.approx(5.0)
