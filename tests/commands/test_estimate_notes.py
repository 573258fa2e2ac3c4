"""What `estimate --by` says while it works, and of many runs."""

import numpy as np
import pytest

from soilml import Estimator
from soilml.cli import progress


@pytest.mark.parametrize("name", ["wheel", "wheel_linear"])
def test_progress_counts_the_rows_that_the_graph_is_given(monkeypatch, name):
    done = []

    class Bar:
        def __init__(self, text, total):
            assert (text, total) == ("estimating", 600)

        def __enter__(self):
            return done.append

        def __exit__(self, *error):
            pass

    monkeypatch.setattr(progress, "progress_bar", Bar)
    estimator = Estimator.load(name)
    slip = np.linspace(0.1, 0.5, 300)
    rows = {"slip": slip, "torque": 1.0 + 3.0 * slip, "load": np.full(300, 60.0)}
    with progress.row_progress("estimating", estimator, 600) as counted:
        inside, found = counted.rows_in_range(**rows), counted.run(**rows)
    assert done == sorted(done) and done[-1] == 600
    assert inside.shape == (300,)
    np.testing.assert_array_equal(found.mean, estimator.run(**rows).mean)
