"""Estimates of a set posterior against the exact posterior of the same sets."""

import numpy as np
import pytest

from training.benchmark.sets.exact_posterior import exact_set_posterior
from training.benchmark.sets.stream_posterior import posterior_of_memory
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.sampler.misfit_test import MisfitLimits
from training.set_posterior.validation import graph_outputs, posterior_session

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def triples(wheel_posterior):
    """(output of the graph, posterior of its memory, exact posterior) of sets; small response."""
    family, response = wheel_posterior.family, wheel_posterior.response
    free = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = posterior_session(SetPosteriorGraph(family, response, free))
    found = []
    for rows in (1, 6):
        sets = family.sets(14, rows, 21)
        for i in range(len(sets.truth)):
            output = graph_outputs(session, response, sets, i)
            system = output["memory_out"].astype(float)
            found.append(
                (
                    output,
                    posterior_of_memory(family, system, sets, i),
                    exact_set_posterior(family, sets, i),
                )
            )
    return found


def test_the_estimate_is_the_mean_of_the_memory_s_posterior(triples):
    off = [(s["set_mean"] - m.mean) / np.sqrt(np.diag(m.covariance)) for s, m, _ in triples]
    assert np.sqrt(np.mean(np.square(off))) < 0.2


def test_the_estimate_is_close_to_the_exact_posterior(triples):
    off = [(s["set_mean"] - e.mean) / np.sqrt(np.diag(e.covariance)) for s, _, e in triples]
    assert np.sqrt(np.mean(np.square(off))) < 0.3
    wide = [s["set_std"] / np.sqrt(np.diag(e.covariance)) for s, _, e in triples]
    assert 0.85 < np.median(wide) < 1.15


def test_the_log_density_at_the_truth_is_that_of_the_exact_posterior(triples):
    gap = [e.log_density - m.log_density for _, m, e in triples]
    assert abs(np.mean(gap)) < 0.2
    assert np.mean([e.log_density for _, _, e in triples]) > 1.0  # both are far above the prior
