"""The product of Gaussian estimates of one soil: against exact inference, and on simulated runs."""

from types import SimpleNamespace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator, Operating
from soilml.onboard.gaussian_product import gaussian_product
from soilml.quantities import SHEAR


def test_it_is_exact_where_everything_is_gaussian_and_independent():
    rng = np.random.default_rng(0)
    prior_mean, prior_std = np.asarray([1.0, -2.0, 0.5]), np.asarray([2.0, 0.5, 1.0])
    prior, P0 = SimpleNamespace(mean=prior_mean, std=prior_std), np.diag(prior_std**-2)
    truth = prior_mean + prior_std * rng.normal(size=3)
    means, covariances, total, right = [], [], P0.copy(), P0 @ prior_mean
    for _ in range(6):
        h, noise = rng.normal(size=3), 0.3
        y = h @ truth + noise * rng.normal()
        gain = np.outer(h, h) / noise**2
        covariances.append(np.linalg.inv(P0 + gain))
        means.append(covariances[-1] @ (P0 @ prior_mean + h * y / noise**2))
        total += gain
        right += h * y / noise**2
    mean, covariance = gaussian_product(np.asarray(means), np.asarray(covariances), prior)
    np.testing.assert_allclose(covariance, np.linalg.inv(total), rtol=1e-6)
    np.testing.assert_allclose(mean, np.linalg.solve(total, right), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wheel_lssvm", "wheel_mlp", "wheel_linear"])
@pytest.mark.parametrize("varies", ["slip and load", "slip", "nothing"])
def test_intervals_of_runs_hold_whatever_varies(name, varies):
    """The range of coverage that `CORRELATION` states, and an error of one row's or less.

    Of steady runs the mean moves too far: its squared error is up to 1.17 times that of one row.
    """
    estimator, case, rng = Estimator.load(name), read_recipe("wheel").case, np.random.default_rng(1)
    held, errors = [], {1: [], 16: []}
    for rows in (1, 4, 16, 32):
        for _ in range(80):
            truth = np.asarray([float(case.prior[k].at(rng.random())) for k in SHEAR])
            slip, load = rng.uniform(0.05, 0.6, rows), rng.uniform(30.0, 120.0, rows)
            slip = np.full(rows, slip[0]) if varies == "nothing" else slip
            load = load if varies == "slip and load" else np.full(rows, load[0])
            soil = case.with_values(dict(zip(SHEAR, truth, strict=True)))
            torque = soil.model(soil.soil, Operating(slip=slip, load=load)).torque
            torque = torque * rng.normal(1.0, 0.02, rows) * rng.normal(1.0, 0.01)
            found = estimator.run(slip=slip, load=load, torque=torque)
            if not found.in_range:
                continue
            if rows > 1:
                held.append((found.low <= truth) & (truth <= found.high))
            if rows in errors:
                errors[rows].append((found.mean - truth) / found.prior_std)
    assert 0.81 <= np.mean(held) <= 0.97
    assert np.mean(np.square(errors[16])) < 1.25 * np.mean(np.square(errors[1]))
