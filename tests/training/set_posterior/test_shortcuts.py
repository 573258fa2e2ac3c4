"""What the graph leaves out where errors are nil is what it computes where they are tiny."""

import numpy as np
import pytest

from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS
from training.set_posterior.validation import graph_outputs, posterior_session

ANSWER = ("set_mean", "set_std", "set_low", "set_high")


@pytest.fixture(scope="module")
def session(wheel_posterior):
    return posterior_session(wheel_posterior)


@pytest.fixture
def sets(wheel_posterior):
    return wheel_posterior.family.sets(12, 6, 3)


def answers(session, posterior, sets, index, **errors) -> dict[str, np.ndarray]:
    return graph_outputs(session, posterior.response, sets, index, errors)


def agree(one, other) -> None:
    for name in ANSWER:
        assert (np.abs(other[name] - one[name]) < 2e-3 * one["set_std"]).all()
    assert other["set_misfit"] == pytest.approx(one["set_misfit"], rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("index", [0, 5])
@pytest.mark.parametrize("errors", [{}, {"slip_bias": 0.01, "load_gain": 0.01}])
def test_a_model_that_is_nearly_right_gives_the_answers_of_one_that_is(
    session, wheel_posterior, sets, index, errors
):
    right = answers(session, wheel_posterior, sets, index, **errors)
    nearly = answers(session, wheel_posterior, sets, index, model_error=1e-5, **errors)
    columns = slice(-len(MODEL_ERROR_COLUMNS), None)
    assert not right["memory_out"][:, columns].any() and nearly["memory_out"][:, columns].any()
    agree(right, nearly)


@pytest.mark.parametrize("index", [0, 5])
def test_rows_whose_slip_is_nearly_exact_give_the_answers_of_exact_ones(
    session, wheel_posterior, sets, index
):
    exact = answers(session, wheel_posterior, sets, index)
    sets.readings["slip_std"] = np.full_like(sets.readings["slip"], 1e-7)
    agree(exact, answers(session, wheel_posterior, sets, index))
