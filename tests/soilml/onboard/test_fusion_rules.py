"""Fusion rules: published weights, optimality, calibration."""

import numpy as np
import pytest
from scipy.optimize import minimize

from soilml.onboard.fusion_rules import best_linear, inverse_variance, pairwise, shrink_correlation

#: Comin and Saaj 2017: variances of torque and vibration, weight of torque. The printed variances
#: are rounded to 0.001, which moves the weight by up to about 0.015.
PRINTED = [
    (0.074, 0.015, 0.172),
    (0.005, 0.015, 0.764),
    (0.018, 0.015, 0.456),
    (0.074, 0.020, 0.211),
    (0.005, 0.020, 0.807),
    (0.018, 0.020, 0.519),
]


@pytest.mark.parametrize(("torque", "vibration", "weight"), PRINTED)
def test_published_slip_weights(torque, vibration, weight):
    std = np.sqrt([torque, vibration])
    for rule in (inverse_variance, pairwise):  # the same for two
        assert rule(np.zeros(2), std).weights[0] == pytest.approx(weight, abs=0.016)


def test_the_middle_line_of_the_pairwise_rule_as_printed_does_not_sum_to_one():
    """Comin and Saaj 2017, eq. 30."""
    T, V, S = 0.3, 0.2, 0.1
    printed = (V / (V + T) + S / (S + T), V / (V + T) + S / (V + S), T / (S + T) + V / (V + S))
    assert abs(sum(printed) / 3 - 1) > 0.05
    weights = pairwise(np.zeros(3), np.sqrt([T, V, S])).weights
    assert 3 * weights == pytest.approx([printed[0], T / (V + T) + S / (V + S), printed[2]])


def test_best_linear_is_the_constrained_optimum():
    rng = np.random.default_rng(2)
    for _ in range(20):
        std = rng.uniform(0.5, 1.5, 3)
        a = rng.normal(size=(3, 2))
        covariance = a @ a.T + 0.1 * np.eye(3)
        d = np.sqrt(np.diag(covariance))
        R = covariance / np.outer(d, d)
        S = R * np.outer(std, std)
        exact = minimize(
            lambda w, S=S: w @ S @ w,
            np.full(3, 1 / 3),
            bounds=[(0, 1)] * 3,
            constraints={"type": "eq", "fun": lambda w: w.sum() - 1},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        found = best_linear(np.zeros(3), std, R)
        np.testing.assert_allclose(found.weights, exact.x, atol=1e-4)
        assert float(found.std) ** 2 == pytest.approx(exact.fun, rel=1e-6)


def drawn(correlation, count=20000):
    """Errors of three estimators that say their own std truly."""
    rng = np.random.default_rng(3)
    R = np.full((3, 3), correlation) + (1 - correlation) * np.eye(3)
    std = np.exp(rng.normal(0.0, 0.2, (3, count)))
    return std * (np.linalg.cholesky(R) @ rng.normal(size=(3, count))), std, R


def covered(rule, correlation):
    error, std, R = drawn(correlation)
    fused = rule(error, std, R) if rule is best_linear else rule(error, std)
    return float(np.mean(np.abs(fused.mean) <= 1.645 * fused.std))


def test_inverse_variance_is_right_for_independent_sensors_only():
    assert covered(inverse_variance, 0.0) == pytest.approx(0.90, abs=0.01)
    assert covered(inverse_variance, 0.95) < 0.70


def test_the_default_is_calibrated_whatever_the_correlation():
    for correlation in (0.0, 0.5, 0.95):
        assert covered(best_linear, correlation) == pytest.approx(0.90, abs=0.015)


def test_shrinking_keeps_a_correlation_matrix():
    R = np.asarray([[1.0, 0.99, 0.5], [0.99, 1.0, 0.6], [0.5, 0.6, 1.0]])
    small = shrink_correlation(R, 0.3)
    np.testing.assert_allclose(np.diag(small), 1.0)
    assert np.linalg.eigvalsh(small).min() > np.linalg.eigvalsh(R).min()
    assert shrink_correlation(np.eye(1)).tolist() == [[1.0]]
