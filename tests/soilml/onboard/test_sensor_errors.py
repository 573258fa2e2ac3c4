"""Errors of slip and load, and errors that all readings share, onboard."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import simulated_run

from soilml.errors import InputError
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS

#: Sensors without errors that all readings share.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)


@pytest.fixture(scope="module")
def estimator(wheel_set_file):
    return Estimator.load(wheel_set_file)


@pytest.mark.parametrize(
    ("name", "size"),
    [("slip_bias", 0.05), ("load_gain", 0.1), ("torque_gain", 0.1)],
)
def test_a_common_error_increases_the_covariance(estimator, wheel_posterior, name, size):
    run, _ = simulated_run(wheel_posterior, 16)
    exact = estimator.on(**EXACT)
    found = [exact.on(**{name: std}).run(**run).covariance for std in (0.0, size)]
    assert np.linalg.det(found[1]) > 1.3 * np.linalg.det(found[0])


@pytest.mark.parametrize(("name", "share"), [("slip", 0.1), ("load", 0.05)])
def test_noise_of_slip_and_load_increases_the_covariance(estimator, wheel_posterior, name, share):
    run, _ = simulated_run(wheel_posterior, 16)
    exact = estimator.on(**EXACT)
    noisy = exact.run(**run, **{f"{name}_std": share * run[name]})
    assert np.linalg.det(noisy.covariance) > 1.3 * np.linalg.det(exact.run(**run).covariance)
    declared = exact.on(noise={name: (0.0, share)}).run(**run)
    assert declared.mean == pytest.approx(noisy.mean, rel=1e-5)
    assert declared.std == pytest.approx(noisy.std, rel=1e-5)


def test_a_common_error_must_be_a_standard_deviation(estimator):
    for value in (-0.1, np.nan, np.inf):
        with pytest.raises(InputError, match=r"slip_bias is .*; needed is a standard deviation"):
            estimator.on(slip_bias=value)


def test_a_file_that_takes_slip_as_exact_says_so(estimator, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 4)
    old = replace(estimator, sets=replace(estimator.sets, common_errors={}, error_columns=1))
    with pytest.raises(InputError, match=r"slip_std is 0.02, but this file takes slip"):
        old.run(**run, slip_std=0.02)
    with pytest.raises(InputError, match=r"torque_gain is 0.05, but this file"):
        old.on(torque_gain=0.05)
    with pytest.raises(InputError, match=r"slip is 0.02, but this file"):
        old.on(noise={"slip": (0.02, 0.0)})
    assert old.on(**EXACT).start().system.shape == (0, estimator.sets.terms + 1)


def test_a_mean_next_to_an_end_of_the_prior_is_at_the_edge(estimator, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 32, x=(0.0, -0.97, 0.0))
    assert estimator.on(**EXACT).run(**run).at_edge[1]
    run, _ = simulated_run(wheel_posterior, 32, x=(0.0, 0.0, 0.0))
    assert not estimator.on(**EXACT).run(**run).at_edge[1]
