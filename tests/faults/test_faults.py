"""A few of the kills of `make faults`."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import fault_run


@pytest.mark.long
def test_a_rerun_after_a_kill_is_as_if_nothing_had_happened(capsys):
    counts = fault_run.Counts()
    fault_run.run(2, 3, counts, commands=("simulate", "generate"))
    assert counts.kills == {"simulate": 1, "generate": 1}
    assert not counts.faults.total(), capsys.readouterr().out
