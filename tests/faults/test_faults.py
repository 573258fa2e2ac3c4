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
