"""A few of the kills of `make faults`."""

import signal
import subprocess
import sys
from contextlib import contextmanager
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


@pytest.mark.parametrize("status, counted", [(130, 1), (3, 0)])
def test_the_time_to_the_end_is_that_of_commands_that_say_they_are_interrupted(
    tmp_path, monkeypatch, status, counted
):
    """A command that waits for the signal, sent before or after it is ready, and 0.3 s more."""
    script = (
        "import signal, sys, time; signal.sigwait({signal.SIGINT}); time.sleep(0.3); "
        f"sys.exit(print('soilml: interrupted', file=sys.stderr) or {status})"
    )

    @contextmanager
    def started(folder, words):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

    monkeypatch.setattr(fault_run, "started", started)
    monkeypatch.setattr(fault_run, "completed", lambda folder, words: 1.0)
    seconds = []
    faults = fault_run.disturbed(tmp_path, "gap", {}, 0.0, signal.SIGINT, seconds)
    assert len(seconds) == counted and all(s > 0.3 for s in seconds)
    assert faults == ([] if counted else ["said 'soilml: interrupted' with status 3"])


def test_an_interruption_ends_the_command_that_runs(tmp_path):
    words = "generate wheel d.parquet --rows 60000"
    with pytest.raises(KeyboardInterrupt), fault_run.started(tmp_path, words) as process:
        raise KeyboardInterrupt
    assert process.returncode == -signal.SIGKILL
    assert not list(tmp_path.iterdir())
