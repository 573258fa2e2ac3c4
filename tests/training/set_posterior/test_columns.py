"""Systems by columns: the same integrals as by rows, and the factor of a QR decomposition."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value
from training.set_posterior.columns import integrate_out_columns, triangular_factor
from training.set_posterior.sensor_errors import integrate_out_errors

KEPT, ERRORS = 7, 3


def run(build, matrix, shape):
    graph = Graph()
    build(Value(graph, "x")).node("Identity").named("y")
    session = session_of(graph.model({"x": shape}, {"y": (1, ["a", "b"])}))
    return session.run(None, {"x": np.asarray(matrix, np.float32)})[0]


@pytest.fixture
def columns():
    return np.random.default_rng(0).normal(size=(KEPT + ERRORS, 12))


def test_errors_are_integrated_out_as_of_rows(columns):
    found = run(lambda x: integrate_out_columns(x, KEPT, ERRORS), columns, ["a", "b"])
    expected = run(lambda x: integrate_out_errors(x, KEPT, ERRORS), columns.T, ["a", "b"])
    np.testing.assert_allclose(found.T, expected, atol=2e-6)


def test_the_factor_is_that_of_a_qr_decomposition(columns):
    count = len(columns)
    found = run(lambda x: triangular_factor(x, count), columns, ["a", "b"])
    assert (np.tril(found, -1) == 0.0).all()
    r = np.linalg.qr(columns.T)[1]
    np.testing.assert_allclose(found, r * np.sign(np.diag(r))[:, None], atol=2e-6)


def test_fewer_readings_than_columns_keep_all_norms(columns):
    """Also where a column is zero: errors of a model that is right."""
    few = columns[:, :4].copy()
    few[2] = 0.0
    found = run(lambda x: triangular_factor(x, len(few)), few, ["a", "b"])
    b = np.random.default_rng(1).normal(size=(len(few), 20))
    np.testing.assert_allclose(
        np.linalg.norm(found @ b, axis=0), np.linalg.norm(few.T @ b, axis=0), rtol=1e-5
    )


def test_half_the_digits_are_not_lost():
    """Nearly dependent columns: normal equations in float32 would lose the small direction."""
    rng = np.random.default_rng(2)
    a = 1e3 * rng.normal(size=(40, 3)) @ np.ones((3, 3)) + 0.1 * rng.normal(size=(40, 3))
    a = a.astype(np.float32)
    found = run(lambda x: triangular_factor(x, 3), a.T, ["a", "b"])
    b = np.linalg.svd(a.astype(np.float64))[2][-1]  # the direction that is known least
    np.testing.assert_allclose(np.linalg.norm(found @ b), np.linalg.norm(a @ b), rtol=0.02)
