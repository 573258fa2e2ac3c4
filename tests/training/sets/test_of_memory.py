"""What a set posterior answers, beside the exact posterior of the same sets."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.quantities import SHEAR
from training.sets.answers import Limits
from training.sets.exact import exact
from training.sets.measured import answered, opened
from training.sets.of_memory import of_memory
from training.sets.one_wheel import OneWheel
from training.sets.posterior import SetPosterior
from training.sets.response import Size, learned


@pytest.fixture(scope="module")
def beside():
    """(answers of the graph, what they stand for, exact) of some sets, by a small response."""
    family = OneWheel.of(read_recipe("wheel"), SHEAR)
    response = learned(family, Size(1024, 32, 250, 0), lambda *told: None)
    free = Limits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = opened(SetPosterior(family, response, free))
    found = []
    for rows in (1, 6):
        sets = family.sets(14, rows, 21)
        for i in range(len(sets.truth)):
            said = answered(session, response, sets, i)
            system = said["memory_out"].astype(float)
            found.append((said, of_memory(family, system, sets, i), exact(family, sets, i)))
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
