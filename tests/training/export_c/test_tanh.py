"""Our hyperbolic tangent in C against the C library's."""

import numpy as np
import pytest
from compiled_c import COMPILERS
from test_operators import called, library, model_of, read, tensors_of

from training.export_c.functions import graph_function
from training.export_c.program import Program, SharedParts


def test_the_hyperbolic_tangent_is_that_of_the_c_library(tmp_path):
    """Over all magnitudes, where it saturates, and for what is no number."""
    if not COMPILERS:
        pytest.skip("no C compiler")
    x = np.concatenate([np.linspace(-12, 12, 40001), np.logspace(-30, 30, 2001)])
    x = np.concatenate([x, [0.0, np.inf, -np.inf, np.nan]]).astype(np.float32)
    model = model_of("Tanh", [x], [], {}, 1)
    shared = SharedParts()
    function = graph_function("tangent", model, Program(shared, {}), tensors_of([x]), ["y0"])
    found = called(library(tmp_path, [function], shared), function, [], {"x0": x})
    y, expected = read(found["y0"], x.size), np.tanh(x.astype(np.float64))
    np.testing.assert_allclose(y, expected, rtol=5e-7)
    assert np.nanmax(np.abs(y)) == 1.0
