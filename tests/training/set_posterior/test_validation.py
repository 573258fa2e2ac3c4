"""Misfit limits of a set posterior: sound sets are estimated."""

import numpy as np
import pytest

from training.set_posterior.validation import graph_outputs, misfit_limits, posterior_session


def test_limits_follow_the_sets_where_these_fit_worse():
    rng = np.random.default_rng(0)
    misfit = 2.0 * rng.chisquare(8, 5000)
    limits = misfit_limits(np.full(5000, 8.0), misfit)
    assert limits.misfit == pytest.approx([np.quantile(misfit, 0.99)])


def test_fewer_outputs_are_the_same_to_the_last_bit(wheel_posterior):
    few, full = (
        posterior_session(wheel_posterior, ("set_misfit",)),
        posterior_session(wheel_posterior),
    )
    sets = wheel_posterior.family.sets(20, 5, 3)
    for k in range(20):
        found, whole = (
            graph_outputs(session, wheel_posterior.response, sets, k) for session in (few, full)
        )
        assert set(found) == {"set_misfit"} < set(whole)
        assert found["set_misfit"] == whole["set_misfit"]
