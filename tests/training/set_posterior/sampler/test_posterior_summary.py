"""Moments of the posterior, and the prior where readings are inconsistent."""

import numpy as np
import pytest

from training.set_posterior.sampler.posterior_summary import prior_summary
from training.set_posterior.validation import graph_outputs, posterior_session


def test_the_estimate_is_the_prior_if_no_soil_explains_the_readings(wheel_posterior):
    sets = wheel_posterior.family.sets(4, 8, 1)
    sets.readings["torque"][0, ::2] *= 2.0
    answer = graph_outputs(posterior_session(wheel_posterior), wheel_posterior.response, sets, 0)
    prior = prior_summary(wheel_posterior.family)
    assert not answer["set_in_range"][0] and answer["set_abstains"].all()
    for name in ("mean", "std", "low", "high"):
        assert answer[f"set_{name}"] == pytest.approx(prior[name], rel=1e-5)
    assert answer["set_covariance"] == pytest.approx(np.diag(prior["std"] ** 2), rel=1e-5)


def test_the_interval_of_the_prior_covers_nine_tenths(wheel_posterior):
    prior, axes = prior_summary(wheel_posterior.family), wheel_posterior.family.axes
    u = np.random.default_rng(0).random(100_000)
    for k, axis in enumerate(axes):
        values = axis.value(axis.quantile(u))
        assert values.mean() == pytest.approx(prior["mean"][k], rel=0.01)
        inside = (values > prior["low"][k]) & (values < prior["high"][k])
        assert inside.mean() == pytest.approx(0.9, abs=0.005)


def test_mean_interval_and_covariance_are_consistent(wheel_posterior):
    sets, session = wheel_posterior.family.sets(6, 8, 1), posterior_session(wheel_posterior)
    for index in range(6):
        answer = graph_outputs(session, wheel_posterior.response, sets, index)
        covariance = answer["set_covariance"]
        assert np.sqrt(np.diag(covariance)) == pytest.approx(answer["set_std"], rel=1e-4)
        spread = np.outer(answer["set_std"], answer["set_std"])
        assert np.linalg.eigvalsh(covariance / spread).min() > 0.0
        assert (answer["set_low"] < answer["set_mean"]).all()
        assert (answer["set_mean"] < answer["set_high"]).all()
