"""Some thousand of the steps of `make endurance`."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from endurance_run import run_day


def test_memory_is_flat_and_estimates_do_not_drift():
    result = run_day(steps=4000, per_soil=2000, seed=3)
    assert len(set(result.bytes_of_memory)) == 1
    assert result.resident[-1] - result.resident[0] < 5e6
    assert result.counts["refused"] == result.counts["not finite"] + result.counts["impossible"] > 0
    assert result.flagged == 0
    assert np.max(result.errors) < 5.0
    assert np.max(result.drifts) < 0.2
