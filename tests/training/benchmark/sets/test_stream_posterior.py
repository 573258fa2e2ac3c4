"""What a set posterior answers, beside the exact posterior of the same sets."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.quantities import SHEAR
from training.benchmark.sets.exact_posterior import exact_posterior
from training.benchmark.sets.stream_posterior import posterior_of_memory
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.posterior_summary import Limits
from training.set_posterior.recipe_family import RecipeFamily
from training.set_posterior.response_surface import ResponseSettings, fit_response
from training.set_posterior.validation import graph_outputs, opened


@pytest.fixture(scope="module")
def beside():
    """(answers of the graph, what they stand for, exact) of some sets, by a small response."""
    family = RecipeFamily.of(read_recipe("wheel"), SHEAR)
    response = fit_response(family, ResponseSettings(1024, 32, 250, 0), lambda *told: None)
    free = Limits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = opened(SetPosteriorGraph(family, response, free))
    found = []
    for rows in (1, 6):
        sets = family.sets(14, rows, 21)
        for i in range(len(sets.truth)):
            said = graph_outputs(session, response, sets, i)
            system = said["memory_out"].astype(float)
            found.append(
                (
                    said,
                    posterior_of_memory(family, system, sets, i),
                    exact_posterior(family, sets, i),
                )
            )
    return found


def test_the_answer_is_the_mean_of_what_the_memory_stands_for(beside):
    off = [(s["set_mean"] - m.mean) / np.sqrt(np.diag(m.covariance)) for s, m, _ in beside]
    assert np.sqrt(np.mean(np.square(off))) < 0.2


def test_the_answer_is_close_to_the_exact_posterior(beside):
    off = [(s["set_mean"] - e.mean) / np.sqrt(np.diag(e.covariance)) for s, _, e in beside]
    assert np.sqrt(np.mean(np.square(off))) < 0.3
    wide = [s["set_std"] / np.sqrt(np.diag(e.covariance)) for s, _, e in beside]
    assert 0.85 < np.median(wide) < 1.15


def test_the_truth_is_as_dense_as_in_the_exact_posterior(beside):
    gap = [e.density - m.density for _, m, e in beside]
    assert abs(np.mean(gap)) < 0.2
    assert np.mean([e.density for _, _, e in beside]) > 1.0  # both tell far more than the prior
