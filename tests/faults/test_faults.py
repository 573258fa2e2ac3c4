"""A few of the kills of `make faults`."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fault_run import run


@pytest.mark.slow
def test_a_rerun_after_a_kill_is_as_if_nothing_had_happened(capsys):
    counts = run(2, seed=3, commands=("simulate", "generate"))
    assert counts["simulate kills"] == counts["generate kills"] == 1
    assert not counts["simulate faults"] + counts["generate faults"], capsys.readouterr().out
