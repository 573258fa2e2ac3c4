"""The posterior for a microcontroller is that of the full graph, to its smaller sample."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.onboard.set_contract import INFERRED
from training.set_posterior.families.wheel_family import TYPICAL_ERRORS
from training.set_posterior.validation import graph_outputs, posterior_session

SETS = 24


def answers(posterior, rows, errors):
    """Means and standard deviations (sets, q) over the prior's, of simulated sets."""
    session = posterior_session(posterior)
    sets = posterior.family.sets(SETS, rows, 99)
    found = [
        graph_outputs(session, posterior.response, sets, k, errors) for k in range(len(sets.truth))
    ]
    return (np.stack([f[f"set_{name}"] for f in found]) for name in ("mean", "std"))


@pytest.mark.slow
@pytest.mark.parametrize("rows", [1, 16])
@pytest.mark.parametrize("errors", [{}, TYPICAL_ERRORS], ids=["right", "inferred"])
@pytest.mark.parametrize("name", ["wheel_posterior", "any_posterior"])
def test_answers_are_those_of_the_full_graph(name, errors, rows, request):
    """Also where bearing values are uncertain, which the small graph takes as linear."""
    posterior = request.getfixturevalue(name)
    assert TYPICAL_ERRORS["model_error"] == INFERRED
    mean, std = answers(posterior, rows, errors)
    small_mean, small_std = answers(replace(posterior, small=True), rows, errors)
    off = np.abs(small_mean - mean) / std
    assert np.sqrt(np.mean(off**2)) < 0.3, off
    assert np.median(np.abs(np.log(small_std / std))) < 0.1


@pytest.mark.slow
def test_contract_and_state_are_those_of_the_full_graph(wheel_posterior):
    """The same inputs, outputs and rows in the memory."""
    small = replace(wheel_posterior, small=True)
    assert small.inputs == wheel_posterior.inputs and small.outputs == wheel_posterior.outputs
    sets = small.family.sets(4, 6, 3)
    found = [
        graph_outputs(posterior_session(p), p.response, sets, 0) for p in (wheel_posterior, small)
    ]
    full, own = (f["memory_out"] for f in found)
    assert full.shape == own.shape
    terms = len(small.response.terms)
    np.testing.assert_array_equal(full[:, :terms], own[:, :terms])
    np.testing.assert_array_equal(found[0]["counted_out"], found[1]["counted_out"])
