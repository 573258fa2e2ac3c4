"""Misfit limits of a set posterior: sound sets are estimated."""

from dataclasses import replace

import numpy as np
import pytest

from training.set_posterior.misfit_test import MisfitLimits
from training.set_posterior.validation import graph_outputs, misfit_limits, posterior_session


def measured_misfits(posterior, rows, count, seed):
    """Number of readings and misfit (sets,) of simulated sets of so many rows."""
    free = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = posterior_session(replace(posterior, limits=free))
    sets = posterior.family.sets(count, rows, seed)
    found = [graph_outputs(session, posterior.response, sets, k) for k in range(len(sets.truth))]
    readings = [outputs["counted_out"][0] for outputs in found]
    return np.asarray(readings), np.asarray([outputs["set_misfit"][0] for outputs in found])


def test_limits_of_exactly_fitted_readings_are_chi_squared():
    limits = misfit_limits(np.repeat([1.0, 2.0, 4.0], 400), np.zeros(1200))
    assert limits.readings.tolist() == [1.0, 2.0, 4.0]
    # 99 % quantiles with 1, 1 and 3 degrees of freedom, Abramowitz and Stegun, table 26.8
    assert limits.misfit == pytest.approx([6.6349, 6.6349, 11.3449], abs=1e-4)


def test_limits_follow_the_sets_where_these_fit_worse():
    rng = np.random.default_rng(0)
    misfit = 2.0 * rng.chisquare(8, 5000)
    limits = misfit_limits(np.full(5000, 8.0), misfit)
    assert limits.misfit == pytest.approx([np.quantile(misfit, 0.99)])


def test_few_sound_rows_are_refused(wheel_posterior):
    limits = misfit_limits(*measured_misfits(wheel_posterior, 1, 600, 51))
    readings, misfit = measured_misfits(wheel_posterior, 1, 1000, 52)
    alone = readings == 1.0
    assert alone.sum() > 600
    assert (misfit[alone] > limits.misfit[0]).mean() < 0.01


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
