"""What the graph leaves out where errors are nil is what it computes where they are tiny."""

import numpy as np
import pytest

from soilml.onboard.set_contract import ERROR_COLUMNS, MODEL_ERROR_COLUMNS
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


@pytest.mark.parametrize("names", [["torque_bias"], ["sinkage_bias", "drawbar_pull_bias"]])
def test_tiny_offsets_of_channels_give_the_answers_of_none(session, wheel_posterior, sets, names):
    index = int(np.argmax(sets.readings["sinkage_std"][:, 0] < 1.0))
    sets.readings["torque_bias"] *= 0.0
    none = answers(session, wheel_posterior, sets, index)
    if names == ["torque_bias"]:
        sets.readings["torque_bias"] += 1e-7
        tiny = answers(session, wheel_posterior, sets, index)
    else:
        tiny = answers(session, wheel_posterior, sets, index, **dict.fromkeys(names, 1e-8))
    terms = len(wheel_posterior.response.terms)
    for name in names:
        column = terms + ERROR_COLUMNS.index(name)
        assert not none["memory_out"][:, column].any() and tiny["memory_out"][:, column].any()
    agree(none, tiny)


def test_a_call_without_rows_has_the_errors_of_its_memory(session, wheel_posterior, sets):
    """Largest and smallest values of no rows are infinite: no size of errors may rest on them."""
    given = {"slip_bias": 0.02, "load_gain": 0.02, "torque_gain": 0.05, "model_error": 1.0}
    found = answers(session, wheel_posterior, sets, 0, **given)
    memory = {"memory": found["memory_out"], "counted": found["counted_out"]}
    shapes = {one.name: one.shape for one in session.get_inputs()}
    nothing = {name: np.zeros(0 if shape == ["rows"] else 1) for name, shape in shapes.items()}
    one_out = {name: np.full(1, np.nan) for name, shape in shapes.items() if shape == ["rows"]}
    names = [one.name for one in session.get_outputs()]
    both = []
    for rows in ({}, one_out):
        feed = nothing | given | rows | memory
        feed = {name: np.asarray(value, np.float32).reshape(-1) for name, value in feed.items()}
        feed["memory"] = memory["memory"]
        both.append(dict(zip(names, session.run(names, feed), strict=True)))
    agree(*both)
