"""Whitening and likelihood against the full covariance matrix."""

import numpy as np
import pytest

from soilml.fitting.covariance import Whitening, squared_residuals_and_log_determinant

RNG = np.random.default_rng(3)
COLUMNS = RNG.standard_normal((12, 5))
STD = RNG.uniform(0.2, 1.5, (4, 12))
RESIDUAL = RNG.standard_normal((4, 12))


def test_whitened_values_have_the_inverse_covariance_as_product():
    covariance = np.diag(STD[0] ** 2) + COLUMNS @ COLUMNS.T
    root = Whitening.beside(1.0 / STD[0], COLUMNS) @ np.eye(12)
    assert root.T @ root == pytest.approx(np.linalg.inv(covariance))


@pytest.mark.parametrize("std", [STD, np.tile(STD[0], (4, 1))])
@pytest.mark.parametrize("columns", [COLUMNS, COLUMNS[:, :0]])
def test_likelihood_is_that_of_the_full_covariance(columns, std):
    squared, half_log = squared_residuals_and_log_determinant(RESIDUAL, std, columns)
    for i in range(4):
        covariance = np.diag(std[i] ** 2) + columns @ columns.T
        assert squared[i] == pytest.approx(RESIDUAL[i] @ np.linalg.solve(covariance, RESIDUAL[i]))
        assert half_log[i] == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1])


def test_tiny_noise_beside_a_large_process_loses_no_digits():
    std, columns = np.full((1, 2), 1e-7), np.ones((2, 1))
    residual = np.asarray([[1.0 + 2e-7, 1.0 - 2e-7]])
    squared = squared_residuals_and_log_determinant(residual, std, columns)[0]
    assert squared[0] == pytest.approx(1.0 + 8.0, rel=1e-3)
