"""Some thousand of the steps of `make endurance`."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from endurance_run import run_day

from soilml.onboard import Estimator


def growth(result):
    """Resident memory of the later soils above that of the earlier ones, bytes, by medians."""
    half = len(result.resident) // 2
    return np.median(result.resident[half:]) - np.median(result.resident[:half])


def test_memory_is_flat_and_estimates_do_not_drift():
    result = run_day(steps=4000, per_soil=2000, seed=3)  # which warms up what is measured below
    assert len(set(result.bytes_of_memory)) == 1
    assert result.counts["refused"] == result.counts["not finite"] + result.counts["impossible"] > 0
    assert result.flagged == 0
    assert np.max(result.errors) < 5.0
    assert np.max(result.drifts) < 0.2
    # the halves are 1000 readings apart, whose memories alone are 18 MB: see the next test
    assert growth(run_day(steps=2000, per_soil=250, seed=4)) < 2e6


def test_memories_that_are_kept_would_be_noticed(monkeypatch):
    kept, step = [], Estimator.step

    def leaking(self, memory, **readings):
        estimate, memory = step(self, memory, **readings)
        kept.append(memory)
        return estimate, memory

    monkeypatch.setattr(Estimator, "step", leaking)
    assert growth(run_day(steps=1000, per_soil=250, seed=5)) > 2e6
