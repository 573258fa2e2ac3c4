"""The factor of moments that begin with 1."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, cholesky_columns


@pytest.mark.parametrize("p", [2, 4, 6])
def test_the_factor_of_moments_is_that_of_numpy(p):
    rng = np.random.default_rng(p)
    points = np.concatenate([np.ones((50, 1)), rng.normal(0.3, 0.4, (50, p - 1))], axis=1)
    moments = points.T @ points / 50.0
    graph = Graph()
    cholesky_columns(Value(graph, "moments"), p).named("factor")
    session = session_of(graph.model({"moments": [p, p]}, {"factor": (1, [p, p])}))
    found = session.run(None, {"moments": moments.astype(np.float32)})[0]
    assert found == pytest.approx(np.linalg.cholesky(moments), abs=1e-4)
    assert found[:, 0] == pytest.approx(points.mean(axis=0), abs=1e-6)
