"""The regressors: exact against brute force, and well-behaved scikit-learn estimators."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

from training.regressors.exact_solution import KernelEigensystem
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.linear_gaussian import LinearGaussian
from training.regressors.lssvm import LSSVM, FixedSizeLSSVM
from training.regressors.nystrom_features import RidgeEigensystem
from training.regressors.rbf_expansion import rbf

ALL = [LSSVM(), FixedSizeLSSVM(), LinearGaussian(), GaussianMLP()]


def curve(count, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-2.0, 2.0, (count, 2))
    clean = np.stack([np.sin(2 * x[:, 0]) + x[:, 1], x[:, 0] * x[:, 1]], axis=1)
    return x, clean + noise * rng.normal(size=clean.shape), clean


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("regressor", ALL, ids=lambda m: m.type_name)
def test_passes_the_checks_of_scikit_learn(regressor):
    results = check_estimator(regressor, on_fail="raise", on_skip=None)
    assert sum(r["status"] == "passed" for r in results) > 40


def bordered(x, y, gamma, width):
    """Dual weights and bias by solving the whole bordered system."""
    n = len(x)
    system = np.zeros((n + 1, n + 1))
    system[0, 1:] = system[1:, 0] = 1.0
    system[1:, 1:] = rbf(x, x, width) + np.eye(n) / gamma
    solution = np.linalg.solve(system, np.vstack([np.zeros((1, y.shape[1])), y]))
    return solution[1:], solution[0], system


def test_solution_is_that_of_the_bordered_system_for_all_outputs_at_once():
    x, y, _ = curve(60)
    alpha, bias, _ = KernelEigensystem.of(rbf(x, x, 0.8)).solve(y, 30.0)
    expected_alpha, expected_bias, _ = bordered(x, y, 30.0, 0.8)
    np.testing.assert_allclose(alpha, expected_alpha, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(bias, expected_bias, rtol=1e-8)
    np.testing.assert_allclose(alpha.sum(axis=0), 0.0, atol=1e-9)


def test_fixed_size_leave_one_out_is_leaving_one_out():
    x, y, _ = curve(40)
    features = rbf(x, x[:9], 1.0)
    ridge, centred = RidgeEigensystem.of(features), y - y.mean(axis=0)
    weights = ridge.solve((features - ridge.mean).T @ centred, 3.0)
    residual = ridge.leave_one_out(ridge.project(features), centred, weights, 3.0)
    for i in range(0, 40, 5):
        rest = np.arange(40) != i
        # ridge with a free bias by its normal equations
        A = np.hstack([features[rest], np.ones((39, 1))])
        penalty = np.diag([1 / 3.0] * 9 + [0.0])
        w = np.linalg.solve(A.T @ A + penalty, A.T @ y[rest])
        left_out = y[i] - features[i] @ w[:-1] - w[-1]
        np.testing.assert_allclose(residual[i], left_out, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "regressor", [LSSVM(), FixedSizeLSSVM(centres=120), GaussianMLP(epochs=240, patience=60)]
)
def test_fits_a_curve_better_than_a_line_and_estimates_the_noise(regressor):
    x, y, _ = curve(900)
    probe, noisy, clean = curve(600, seed=1)
    mean, std = clone(regressor).fit(x, y).predict(probe, return_std=True)
    error = np.sqrt(np.mean((mean - clean) ** 2))
    straight = LinearGaussian().fit(x, y).predict(probe)
    assert error < 0.2 * np.sqrt(np.mean((straight - clean) ** 2))
    assert error < 0.06
    inside = np.mean(np.abs(noisy - mean) <= 1.645 * std)
    assert 0.82 < inside < 0.96


def test_std_does_not_shrink_far_from_the_data():
    x, y, _ = curve(400)
    for regressor in (
        LSSVM(),
        FixedSizeLSSVM(centres=50),
        GaussianMLP(epochs=20),
        LinearGaussian(),
    ):
        fitted = regressor.fit(x, y)
        near = fitted.predict(x, return_std=True)[1]
        far = fitted.predict(50.0 * x, return_std=True)[1]
        assert (far >= 0.98 * near.min(axis=0)).all()
        assert np.isfinite(far).all()


def test_training_stops_early_when_held_out_rows_get_worse():
    x, y, _ = curve(40, noise=1.0)
    regressor = GaussianMLP(hidden=(64, 64), epochs=400, patience=5, batch=8).fit(x, y)
    assert len(regressor.history_) < 400


def test_the_public_regressors_work_in_pipelines_and_searches():
    import soilml.regressors
    from soilml.regressors import FixedSizeLSSVM as Public

    assert Public is FixedSizeLSSVM
    assert dir(soilml.regressors) == soilml.regressors.__all__
    assert all(getattr(soilml.regressors, name) for name in soilml.regressors.__all__)
    with pytest.raises(AttributeError, match="has no 'Forest'"):
        _ = soilml.regressors.Forest
    x, y, _ = curve(200)
    pipeline = make_pipeline(StandardScaler(), Public(centres=20))
    search = GridSearchCV(pipeline, {"fixedsizelssvm__centres": [3, 40]}, cv=3).fit(x, y)
    assert search.best_params_ == {"fixedsizelssvm__centres": 40}
    mean, std = search.best_estimator_.predict(x, return_std=True)
    assert mean.shape == std.shape == y.shape and (std > 0.0).all()
    np.testing.assert_array_equal(mean, search.predict(x))
