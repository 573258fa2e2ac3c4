"""A file written anew around the response that it has gives the answers that it gave."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from soilml.onboard.estimator import Estimator

sys.path.insert(0, str(Path(__file__).parents[3] / "exported"))

from stored_response import write_anew

pytestmark = pytest.mark.slow

ROWS = {"slip": [0.1, 0.2, 0.3, 0.5], "torque": [1.6, 2.3, 2.7, 3.2], "load": [60.0] * 4}


@pytest.mark.parametrize("size", [-1.0, 0.0, 1.0])
def test_the_answers_are_the_same(whole_file, tmp_path, size):
    again = tmp_path / "again.onnx"
    shutil.copy(whole_file, again)
    write_anew(again)
    before, after = (Estimator.load(path).on(model_error=size) for path in (whole_file, again))
    assert after.run(**ROWS).in_range
    assert after.run(**ROWS).mean == pytest.approx(before.run(**ROWS).mean, rel=1e-3)
    assert after.run(**ROWS).std == pytest.approx(before.run(**ROWS).std, rel=1e-3)
    np.testing.assert_array_equal(after(**ROWS).mean, before(**ROWS).mean)
