"""Readings become rows of a linear system, in standard deviations of their noise."""

import numpy as np
import pytest

from soilml.onboard.set_contract import COMMON_ERROR_INPUTS, ERROR_COLUMNS, MEMORY_INPUTS
from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, constant
from training.set_posterior.graph import ROW_INPUTS
from training.set_posterior.monomials import monomials
from training.set_posterior.residual_system import add_residual_rows
from training.set_posterior.sensor_errors import integrate_out_errors, whiten_rows
from training.set_posterior.validation import graph_outputs, posterior_session


@pytest.fixture(scope="module")
def session(wheel_posterior):
    return posterior_session(wheel_posterior)


@pytest.fixture(scope="module")
def sets(wheel_posterior):
    return wheel_posterior.family.sets(40, 6, 3)


def test_the_system_has_residuals_over_noise(wheel_posterior, session, sets):
    response, x = wheel_posterior.response, np.asarray([0.2, -0.4, 0.6])
    index = int(np.argmax(sets.readings["sinkage_std"][:, 0] < 1.0))
    system = graph_outputs(session, response, sets, index)["memory_out"].astype(np.float64)
    own = sets.rows(index)
    y = response.predict(np.log(np.stack([own["slip"], own["load"]], axis=1)), x)
    share = own["torque_std"] / own["torque"]
    off = {
        "torque": y[:, 0] - np.log(own["torque"] / own["load"]) - 0.5 * share**2,
        "sinkage": y[:, 1] - np.log(own["sinkage"]),
        "drawbar_pull": y[:, 2] - own["drawbar_pull"] / own["load"],
    }
    noise = (share, own["sinkage_std"] / own["sinkage"], own["drawbar_pull_std"] / own["load"])
    for k, (values, std) in enumerate(zip(off.values(), noise, strict=True)):
        found = system[6 * k : 6 * k + 6, : len(response.terms)] @ monomials(x, response.terms)
        assert found == pytest.approx(values / np.hypot(std, response.error[k]), abs=2e-3)


def test_a_channel_that_was_not_measured_has_no_row(wheel_posterior, session, sets):
    torque_only = int(np.argmax(sets.readings["sinkage_std"][:, 0] > 1e5))
    found = graph_outputs(session, wheel_posterior.response, sets, torque_only)
    assert len(found["memory_out"]) == 6
    assert found["counted_out"].tolist() == [6.0, 6.0, 6.0]


def test_common_errors_are_integrated_out_of_the_likelihood():
    rng = np.random.default_rng(0)
    a, g, b = rng.normal(size=(8, 5)), rng.normal(size=(8, 3)), rng.normal(size=5)
    graph = Graph()
    integrate_out_errors(Value(graph, "system"), 5, 3).named("out")
    session = session_of(graph.model({"system": ["m", 8]}, {"out": (1, ["m", 5])}))
    system = np.concatenate([a, g], axis=1).astype(np.float32)
    found = session.run(None, {"system": system})[0] @ b
    dense = np.linalg.solve(np.eye(8) + g @ g.T, a @ b)
    assert found @ found == pytest.approx((a @ b) @ dense, rel=1e-5)
    steady = np.concatenate([a, 0.0 * g], axis=1).astype(np.float32)
    assert session.run(None, {"system": steady})[0] == pytest.approx(a, abs=1e-6)


def test_errors_of_a_row_are_integrated_out_of_its_channels_alone():
    rng = np.random.default_rng(0)
    a, g, b = rng.normal(size=(3, 4, 5)), rng.normal(size=(3, 4, 2)), rng.normal(size=5)
    graph = Graph()
    whiten_rows(Value(graph, "system"), Value(graph, "errors")).named("out")
    shapes = {"system": [5, "readings"], "errors": [2, "readings"]}
    session = session_of(graph.model(shapes, {"out": (1, [5, "readings"])}))
    feed = {"system": a.reshape(12, 5).T, "errors": g.reshape(12, 2).T}
    found = session.run(None, {name: value.astype(np.float32) for name, value in feed.items()})[0]
    found = (b @ found).reshape(3, 4)
    for row in range(4):
        covariance = np.eye(3) + g[:, row] @ g[:, row].T
        own = a[:, row] @ b
        expected = own @ np.linalg.solve(covariance, own)
        assert found[:, row] @ found[:, row] == pytest.approx(expected, rel=1e-5)


#: Errors, and their sizes: small enough for the residuals to be linear in them.
ERRORS = {"slip": 0.001, "load": 0.01, "torque": 0.01}
COLUMN = {"slip": "slip_bias", "load": "load_gain", "torque": "torque_gain"}


@pytest.mark.parametrize("name", ERRORS)
@pytest.mark.parametrize("x", [None, (0.5, -0.6, 0.4)])
def test_columns_of_common_errors_are_changes_of_the_residuals(wheel_posterior, sets, name, x):
    response, size = wheel_posterior.response, ERRORS[name]
    own = sets.rows(int(np.argmax(sets.readings["sinkage_std"][:, 0] < 1.0)))
    own["torque_bias"] = 0.0 * own["slip"]
    at_soil = monomials(np.asarray(x or (0.0, 0.0, 0.0)), response.terms)
    graph, inputs = Graph(), {}
    for key in wheel_posterior.inputs:
        if key not in MEMORY_INPUTS:
            given = Value(graph, key)
            inputs[key] = given.reshape(1, -1) if key in ROW_INPUTS else given
    _, rows = add_residual_rows(wheel_posterior.family, response, inputs)
    basis = None if x is None else constant(graph, at_soil[:, None])
    rows.compressed(rows.columns_at(basis)).named("out")
    shapes = {key: wheel_posterior.inputs[key] for key in inputs}
    session = session_of(graph.model(shapes, {"out": (1, ["m", "columns"])}))

    def residuals(changed, error):
        """Residuals and columns of errors, on the scales of the channels."""
        feed = {key: np.zeros(1 if key in COMMON_ERROR_INPUTS else 6) for key in inputs}
        feed |= own | changed | {COLUMN[name]: np.full(1, error)}
        noise = [
            feed["torque_std"] / feed["torque"],
            feed["sinkage_std"] / feed["sinkage"],
            feed["drawbar_pull_std"] / feed["load"],
        ]
        std = np.hypot(noise, response.error[:, None]).reshape(-1, 1)
        feed = {key: values.astype(np.float32) for key, values in feed.items()}
        system = session.run(None, feed)[0].astype(np.float64) * std
        return system[:, : len(response.terms)] @ at_soil, system[:, len(response.terms) :]

    up, down = (
        residuals({name: own[name] + e if name == "slip" else own[name] * (1.0 + e)}, 0.0)[0]
        for e in (size, -size)
    )
    columns = residuals({}, 2.0 * size)[1]
    found = columns[:, ERROR_COLUMNS.index(COLUMN[name])]
    # the sign of an error with a symmetric prior is arbitrary
    expected = down - up if name == "torque" else up - down
    assert found == pytest.approx(expected, rel=0.02, abs=0.02 * np.abs(expected).max())
    others = np.delete(columns, ERROR_COLUMNS.index(COLUMN[name]), axis=1)
    assert not others.any()


def test_a_row_out_of_range_by_its_noise_is_left_out_and_not_counted(wheel_posterior, session):
    sets = wheel_posterior.family.sets(1, 8, 3)
    lowest = wheel_posterior.family.recipe.slip.lower
    for index in range(5):
        sets.readings["slip"][0, index] = 0.6 * lowest
    exact = graph_outputs(session, wheel_posterior.response, sets, 0)
    assert exact["counted_out"][1:].tolist() == [8.0, 3.0] and not exact["set_in_range"][0]
    sets.readings["slip_std"] = np.full((1, 8), 0.2 * lowest)
    noisy = graph_outputs(session, wheel_posterior.response, sets, 0)
    assert noisy["counted_out"].tolist() == [exact["counted_out"][0], 8.0, 8.0]
    assert noisy["row_in_range"].tolist() == [False] * 5 + [True] * 3
    assert noisy["set_in_range"][0]
