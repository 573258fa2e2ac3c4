"""The regressors: exact against brute force, and well-behaved scikit-learn estimators."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

import soilml.regressors
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.gaussian_regressor import folds_of
from training.regressors.linear_gaussian import LinearGaussian
from training.regressors.lssvm import LSSVM
from training.regressors.nystrom_features import NystromFeatures, rbf

ALL = [LSSVM(gamma=10.0, width=1.0), LinearGaussian(), GaussianMLP()]


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


def test_rows_left_out_in_closed_form_are_those_of_fits_without_them():
    x, y, _ = curve(120)
    groups, regressor = np.repeat(np.arange(24), 5), LSSVM(30, gamma=30.0, width=0.8)
    mean, _ = regressor.fit_left_out(x, y, groups, lambda done, total: None)
    u, z = regressor.x_scaling_.apply(x), regressor.y_scaling_.apply(y)
    phi = NystromFeatures.of(regressor.centres_, 0.8).at(u)
    for k in range(20):
        out = folds_of(groups) == k
        assert len(np.intersect1d(groups[out], groups[~out])) == 0 < out.sum() < 30
        a, middle = phi[~out] - phi[~out].mean(axis=0), z[~out].mean(axis=0)
        weights = np.linalg.solve(a.T @ a + np.eye(phi.shape[1]) / 30.0, a.T @ (z[~out] - middle))
        expected = middle + (phi[out] - phi[~out].mean(axis=0)) @ weights
        found = regressor.y_scaling_.apply(mean[out])
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


def test_with_as_many_centres_as_rows_it_is_the_exact_solution_of_the_dual():
    x, y, _ = curve(100)
    regressor = LSSVM(100, gamma=30.0, width=0.8).fit(x, y)
    u, z = regressor.x_scaling_.apply(x), regressor.y_scaling_.apply(y)
    system = np.ones((101, 101))
    system[0, 0], system[1:, 1:] = 0.0, rbf(u, u, 0.8) + np.eye(100) / 30.0
    solution = np.linalg.solve(system, np.vstack([np.zeros((1, 2)), z]))
    probe = curve(50, seed=1)[0]
    expected = rbf(regressor.x_scaling_.apply(probe), u, 0.8) @ solution[1:] + solution[0]
    found = regressor.y_scaling_.apply(regressor.predict(probe))
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("regressor", [LSSVM(centres=120), GaussianMLP(epochs=300, batch=64)])
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
    for regressor in (LSSVM(centres=50), GaussianMLP(epochs=20), LinearGaussian()):
        fitted = regressor.fit(x, y)
        near = fitted.predict(x, return_std=True)[1]
        far = fitted.predict(50.0 * x, return_std=True)[1]
        assert (far >= 0.98 * near.min(axis=0)).all()
        assert np.isfinite(far).all()


def test_the_public_regressors_work_in_pipelines_and_searches():
    assert soilml.regressors.LSSVM is LSSVM
    assert dir(soilml.regressors) == soilml.regressors.__all__
    assert all(getattr(soilml.regressors, name) for name in soilml.regressors.__all__)
    with pytest.raises(AttributeError, match="has no 'Forest'"):
        _ = soilml.regressors.Forest
    x, y, _ = curve(200)
    pipeline = make_pipeline(StandardScaler(), LSSVM(centres=20))
    search = GridSearchCV(pipeline, {"lssvm__centres": [3, 40]}, cv=3).fit(x, y)
    assert search.best_params_ == {"lssvm__centres": 40}
    mean, std = search.best_estimator_.predict(x, return_std=True)
    assert mean.shape == std.shape == y.shape and (std > 0.0).all()
    np.testing.assert_array_equal(mean, search.predict(x))
