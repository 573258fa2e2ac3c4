"""The table of many days, from counts of two days."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

from streams import Tally, _long_line


def test_a_line_has_shares_of_days_with_their_standard_errors():
    days = [
        Tally(
            covered=[np.array([True, True, False])] * 10,
            answered=[True] * 30,
            false_alarms=[False] * 99,
            stuck=[True] * 4,
            slip_stuck=[1.0],
        ),
        Tally(
            covered=[np.array([True, False, False])] * 40,
            answered=[False] * 10,
            false_alarms=[True],
            stuck=[False] * 4,
            slip_stuck=[3.0],
        ),
    ]
    line = ("2", "100.0 +- 0.0", "50.0 +- 50.0", "0.0 +- 0.0", "75.0", "10.0", "3", "50.0")
    assert _long_line(days) == line
