"""LS-SVM with a shared part of its outputs, against what its equations say."""

import numpy as np
import pytest

from soilml.errors import InputError
from training.regressors.coupled_lssvm import CoupledLSSVM
from training.regressors.lssvm import LSSVM
from training.regressors.rbf_expansion import rbf
from training.spec import read_spec


def views(n, noise, seed):
    """Three noisy views of one quantity, one of them reversed."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-2.0, 2.0, (n, 2))
    one = np.sin(2.0 * x[:, 0]) + 0.5 * x[:, 1]
    return x, one[:, None] * [1.0, -2.0, 0.5] + noise * rng.standard_normal((n, 3)) * [1, 2, 0.5]


def test_the_weights_solve_the_joint_system_of_all_outputs():
    """Xu et al. 2013: (K (x) B + I / gamma) a + b = y, with sum(a) = 0 for each output."""
    x, y = views(25, 0.3, 1)
    gamma, width, c = 20.0, 1.1, 0.7
    found = CoupledLSSVM(coupling=c, gamma=gamma, width=width).fit(x, y)
    z, q = found.y_scaling_.apply(y), 3
    signs = np.asarray([1.0, -1.0, 1.0])
    between = (1.0 - c) * np.eye(q) + c * np.outer(signs, signs)
    scaled = found.x_scaling_.apply(x)
    joint = np.kron(between, rbf(scaled, scaled, width)) + np.eye(q * 25) / gamma
    ones = np.kron(np.eye(q), np.ones((25, 1)))
    system = np.block([[np.zeros((q, q)), ones.T], [ones, joint]])
    solved = np.linalg.solve(system, np.concatenate([np.zeros(q), z.T.ravel()]))
    weights = solved[q:].reshape(q, 25).T @ between
    np.testing.assert_allclose(found.expansion_.alpha, weights, atol=1e-9)
    np.testing.assert_allclose(found.expansion_.bias, solved[:q], atol=1e-9)


def test_residuals_of_rows_left_out_are_those_of_fits_without_them():
    x, y = views(20, 0.3, 2)
    found = CoupledLSSVM(coupling=0.6, gamma=5.0, width=1.0).fit(x, y)
    solution = found.solution_for(19)
    z, scaled = found.y_scaling_.apply(y), found.x_scaling_.apply(x)
    for k in (0, 7, 19):
        others = np.delete(np.arange(20), k)
        own = solution.solve(scaled[others], z[others], None, lambda done, count: None)
        at = rbf(scaled[k : k + 1], scaled[others], 1.0) @ own.alpha + own.bias
        np.testing.assert_allclose(found.expansion_.residual[k], z[k] - at[0], atol=1e-9)


def test_without_a_shared_part_it_is_the_lssvm():
    x, y = views(40, 0.3, 3)
    settings = {"gamma": 30.0, "width": 1.2}
    one, other = CoupledLSSVM(coupling=0.0, **settings).fit(x, y), LSSVM(**settings).fit(x, y)
    for ours, theirs in zip(one.predict(x, True), other.predict(x, True), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-8)


def test_views_of_one_quantity_share_and_are_learned_better():
    gains, shares = [], []
    for seed in range(10, 16):
        x, y = views(30, 1.0, seed)
        test, truth = views(1000, 0.0, seed + 100)
        pair = [m.fit(x, y) for m in (LSSVM(), CoupledLSSVM())]
        own, shared = (np.mean((m.predict(test) - truth) ** 2) for m in pair)
        gains.append(shared / own)
        shares.append(float(pair[1].expansion_.solution.split()[2]))
    assert np.median(gains) < 0.95 and np.median(shares) >= 0.8


def test_outputs_with_nothing_in_common_are_learned_as_well_as_without_a_shared_part():
    """The selected share is not zero then: leave-one-out hardly depends on it."""
    ratios = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        x = rng.uniform(-2.0, 2.0, (580, 2))
        clean = np.column_stack([np.sin(3.0 * x[:, 0]), np.cos(3.0 * x[:, 1])])
        y = clean[:80] + 0.1 * rng.standard_normal((80, 2))
        pair = [m.fit(x[:80], y) for m in (LSSVM(), CoupledLSSVM())]
        own, shared = (np.mean((m.predict(x[80:]) - clean[80:]) ** 2) for m in pair)
        ratios.append(shared / own)
    assert np.median(ratios) < 1.05


def test_a_spec_takes_it_by_name_and_the_settings_say_how_much_is_shared(tmp_path):
    text = 'targets = ["cohesion", "friction_angle"]\n[[regressor]]\ntype = "coupled-lssvm"\n'
    (tmp_path / "s.toml").write_text(text)
    (subset,) = read_spec(tmp_path / "s.toml").regressors
    x, y = views(30, 0.3, 4)
    assert "shared part 0." in subset.model.fit(x, y).fitted_settings()


def test_more_rows_and_a_full_share_are_refused():
    x, y = views(1600, 0.3, 5)
    with pytest.raises(InputError, match="1600 rows; needed are at most 1500"):
        CoupledLSSVM().fit(x, y)
    with pytest.raises(InputError, match="coupling is 1; needed is a number from 0 to below 1"):
        CoupledLSSVM(coupling=1.0).fit(x[:20], y[:20])
