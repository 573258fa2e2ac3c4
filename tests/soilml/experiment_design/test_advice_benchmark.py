"""The benchmark of following the advice, on a few soils."""

import sys
from pathlib import Path

import numpy as np
import pytest

from soilml import read_case

pytestmark = pytest.mark.slow

BENCH = Path(__file__).parents[3] / "bench"


def test_an_advised_row_tells_more_than_repeating_and_as_much_as_was_promised(
    model_file, monkeypatch
):
    monkeypatch.syspath_prepend(str(BENCH))
    monkeypatch.delitem(sys.modules, "advice", raising=False)
    import advice

    found = advice.driven(read_case(model_file), rows=1, soils=8, seed=2, samples=512)
    _, std = found.root_mean_square()
    width = dict(zip(advice.KINDS, np.sqrt(np.mean(std**2, axis=1)), strict=True))
    assert width["advised"] < 0.9 * width["repeat"]
    assert width["repeat"] > 0.95 * width["nothing"]
    expected = np.sqrt(np.mean(found.expected**2))
    assert width["advised"] == pytest.approx(expected, rel=0.2)
