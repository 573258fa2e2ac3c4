"""The benchmark of following the advice, on a few soils."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from soilml import Estimator, read_case
from soilml.identification.model_error_inputs import with_exact_model

pytestmark = pytest.mark.slow

BENCH = Path(__file__).parents[3] / "bench"


@pytest.fixture
def advice(monkeypatch):
    """The script of the benchmark."""
    monkeypatch.syspath_prepend(str(BENCH))
    monkeypatch.delitem(sys.modules, "advice", raising=False)
    return importlib.import_module("advice")


def test_an_advised_row_tells_more_than_repeating_and_as_much_as_was_promised(model_file, advice):
    found = advice.driven(read_case(model_file), rows=1, soils=8, seed=2, samples=512)
    _, std = found.root_mean_square()
    width = dict(zip(advice.KINDS, np.sqrt(np.mean(std**2, axis=1)), strict=True))
    assert width["advised"] < 0.9 * width["repeat"]
    assert width["repeat"] > 0.95 * width["nothing"]
    expected = np.sqrt(np.mean(found.expected**2))
    assert width["advised"] == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize("mode", [lambda file: file, with_exact_model], ids=["default", "exact"])
def test_a_file_leaves_what_it_promised_in_the_mode_in_which_it_answers(advice, mode):
    promised, answered = advice.promises(mode(Estimator.load("wheel")), soils=24, rows=2)
    left, found = (np.sqrt(np.mean(part**2, axis=0)) for part in (promised, answered))
    np.testing.assert_allclose(left, found, rtol=0.12)
