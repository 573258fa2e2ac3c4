"""The regressors: exact against brute force, and well-behaved scikit-learn estimators."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.linear_gaussian import LinearGaussian
from training.regressors.lssvm import LSSVM, FixedSizeLSSVM
from training.regressors.nystrom_features import NystromFeatures
from training.regressors.rbf_expansion import rbf
from training.regressors.row_groups import folds_of
from training.regressors.tiled_cholesky import tiles_of

ALL = [
    LSSVM(gamma=10.0, width=1.0),
    FixedSizeLSSVM(gamma=10.0, width=1.0),
    LinearGaussian(),
    GaussianMLP(),
]


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


@pytest.mark.parametrize(
    "regressor", [LSSVM(gamma=30.0, width=0.8), FixedSizeLSSVM(30, gamma=30.0, width=0.8)]
)
def test_rows_left_out_in_closed_form_are_those_of_fits_without_them(regressor):
    """Every row is estimated as by the whole bordered system without its tile or fold."""
    x, y, _ = curve(120)
    groups = np.repeat(np.arange(24), 5)
    mean, _ = regressor.fit_left_out(x, y, groups, lambda done, total: None)
    u, z = regressor.x_scaling_.apply(x), regressor.y_scaling_.apply(y)
    if isinstance(regressor, FixedSizeLSSVM):
        outs, exact = [folds_of(groups) == k for k in range(20)], False
    else:
        order, slices = tiles_of(groups)
        outs, exact = [np.isin(np.arange(120), order[rows]) for rows in slices], True
    for out in outs:
        assert len(np.intersect1d(groups[out], groups[~out])) == 0 < out.sum() < 30
        if exact:
            centres, kernel = u[~out], rbf(u[~out], u[~out], 0.8) + np.eye((~out).sum()) / 30.0
        else:  # in the primal, with the features of all centres
            features = NystromFeatures.of(regressor.expansion_.centres, 0.8)
            phi = features.at(u)
            a = phi[~out] - phi[~out].mean(axis=0)
            weights = np.linalg.solve(
                a.T @ a + np.eye(phi.shape[1]) / 30.0, a.T @ (z[~out] - z[~out].mean(axis=0))
            )
            expected = z[~out].mean(axis=0) + (phi[out] - phi[~out].mean(axis=0)) @ weights
            np.testing.assert_allclose(
                regressor.y_scaling_.apply(mean[out]), expected, rtol=1e-6, atol=1e-8
            )
            continue
        n = len(centres)
        system = np.zeros((n + 1, n + 1))
        system[0, 1:] = system[1:, 0] = 1.0
        system[1:, 1:] = kernel
        solution = np.linalg.solve(system, np.vstack([np.zeros((1, 2)), z[~out]]))
        expected = rbf(u[out], centres, 0.8) @ solution[1:] + solution[0]
        np.testing.assert_allclose(regressor.y_scaling_.apply(mean[out]), expected, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "regressor", [LSSVM(), FixedSizeLSSVM(centres=120), GaussianMLP(epochs=300, batch=64)]
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
