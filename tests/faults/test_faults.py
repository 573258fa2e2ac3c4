"""A few of the kills of `make faults`."""

import signal
import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import fault_run


@pytest.mark.slow
def test_a_rerun_after_a_kill_is_as_if_nothing_had_happened(capsys):
    counts = Counter()
    fault_run.run(2, 3, counts, commands=("simulate", "generate"))
    assert counts["simulate kills"] == counts["generate kills"] == 1
    assert not counts["simulate faults"] + counts["generate faults"], capsys.readouterr().out


def test_an_interruption_prints_the_counts(monkeypatch, capsys):
    answers = iter([["one fault"], [], []])

    def disturbed(*_):
        if (faults := next(answers, None)) is None:
            raise KeyboardInterrupt
        return faults

    monkeypatch.setattr(fault_run, "prepared", lambda folder: None)
    monkeypatch.setattr(fault_run, "completed", lambda folder, words: 1.0)
    monkeypatch.setattr(fault_run, "disturbed", disturbed)
    monkeypatch.setattr(sys, "argv", ["fault_run", "--kills", "10", "simulate", "gap"])
    assert fault_run.main() == 130
    printed = capsys.readouterr()
    assert [line.split() for line in printed.out.splitlines()[-2:]] == [
        ["simulate", "2", "kills", "1", "faults"],
        ["gap", "1", "kills", "0", "faults"],
    ]
    assert printed.err.splitlines()[-1] == "interrupted after 3 of 10 kills"


def test_an_interruption_ends_the_command_that_runs(tmp_path):
    words = "generate wheel d.parquet --rows 60000"
    with pytest.raises(KeyboardInterrupt), fault_run.started(tmp_path, words) as process:
        raise KeyboardInterrupt
    assert process.returncode == -signal.SIGKILL
    assert not list(tmp_path.iterdir())
