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
