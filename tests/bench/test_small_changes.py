"""Counts of the benchmark of small changes, without a file."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

from driven_days import Day, Kind
from small_changes import Findings


def test_changes_are_counted_once_and_only_late_rows_can_be_false():
    kinds = (Kind.SOUND,) * 300
    day = Day({}, np.zeros((300, 3)), kinds, ((100, 0.1), (200, 0.3)))
    found = Findings()
    found.add(day, {50, 104, 110, 150, 203})
    assert found.delays == [5.0]  # the larger change is no small one
    # rows 0 to 99, 140 to 199 and 240 to 299; of these 50 and 150 are false
    assert (len(found.false), sum(found.false)) == (220, 2)
    found.add(day, set())
    assert found.line("x") == "| x | 2 | 50% | 50% | inf | 4.5 |"
