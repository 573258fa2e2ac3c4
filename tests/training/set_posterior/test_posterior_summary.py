"""Moments of the posterior, and the prior where readings are inconsistent."""

from dataclasses import replace

import numpy as np
import pytest

from training.set_posterior.posterior_summary import prior_summary
from training.set_posterior.validation import graph_outputs, posterior_session


def test_the_estimate_is_the_prior_without_a_row_in_range(wheel_posterior):
    sets = wheel_posterior.family.sets(4, 8, 1)
    sets.readings["load"][0] *= 100.0
    answer = graph_outputs(posterior_session(wheel_posterior), wheel_posterior.response, sets, 0)
    prior = prior_summary(wheel_posterior.family)
    assert not answer["set_in_range"][0] and answer["set_abstains"].all()
    for name in ("mean", "std", "low", "high"):
        assert answer[f"set_{name}"] == pytest.approx(prior[name], rel=1e-5)
    assert answer["set_covariance"] == pytest.approx(np.diag(prior["std"] ** 2), rel=1e-5)


def test_a_misfit_widens_the_estimate_and_flags_it(wheel_posterior):
    session, sets = posterior_session(wheel_posterior), wheel_posterior.family.sets(12, 16, 1)
    prior = prior_summary(wheel_posterior.family)
    sound = [graph_outputs(session, wheel_posterior.response, sets, k) for k in range(12)]
    noise = np.random.default_rng(0).standard_normal(sets.readings["torque"].shape)
    narrower = []
    for size in (5.0, 20.0):
        readings = sets.readings["torque"] + size * sets.readings["torque_std"] * noise
        noisy = replace(sets, readings=sets.readings | {"torque": readings})
        found = [graph_outputs(session, wheel_posterior.response, noisy, k) for k in range(12)]
        assert not any(answer["set_in_range"][0] for answer in found)
        widths = [a["set_std"] / b["set_std"] for a, b in zip(found, sound, strict=True)]
        assert np.median(widths) > 1.5
        narrower.append(np.mean([answer["set_std"] / prior["std"] for answer in found]))
    assert narrower[0] < narrower[1] < 1.05


def test_a_mean_next_to_an_end_of_the_prior_is_at_the_edge(wheel_posterior):
    session, sets = posterior_session(wheel_posterior), wheel_posterior.family.sets(12, 16, 1)
    ends = np.asarray([axis.ends for axis in wheel_posterior.family.axes])
    flags = []
    for index in range(12):
        answer = graph_outputs(session, wheel_posterior.response, sets, index)
        mean, margin = answer["set_mean"], 1.5 * answer["set_std"]
        expected = (mean - margin < ends[:, 0]) | (mean + margin > ends[:, 1])
        assert (answer["set_at_edge"] == expected).all()
        flags.append(expected)
    assert 0 < np.sum(flags) < np.size(flags)


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
