"""Progress where standard error is no terminal: few lines, none for quick work."""

import pytest

from soilml.cli import progress, tables
from soilml.cli.tables import read_long_table
from soilml.errors import TableError


@pytest.fixture
def clock(monkeypatch):
    """Seconds that a test sets."""

    class Clock:
        now = 0.0

        def monotonic(self):
            return self.now

    clock = Clock()
    monkeypatch.setattr(progress, "time", clock)
    return clock


def test_quick_work_is_silent(clock, capsys):
    with progress.progress_bar("simulating", 10) as done:
        for i in range(10):
            clock.now += 0.1
            done(i + 1)
    assert capsys.readouterr().err == ""


def test_long_work_says_a_line_now_and_then(clock, capsys):
    with progress.progress_bar("simulating", 100) as done:
        for i in range(100):
            clock.now += 1.0
            done(i + 1)
    lines = capsys.readouterr().err.splitlines()
    left = {2: "2 min", 22: "78 s", 42: "58 s", 62: "38 s", 82: "18 s"}
    assert lines == [f"simulating: {done} %, about {rest} left" for done, rest in left.items()]


def test_stages_say_that_they_begin_and_how_far_they_are(clock, capsys):
    with progress.stage_progress() as tell:
        for i in range(30):
            clock.now += 1.0
            tell("training", i, 30)
    assert capsys.readouterr().err.splitlines() == [
        "training ...",
        "training: 66 %, about 10 s left",
    ]


def test_work_of_unknown_length_says_one_line(monkeypatch, capsys):
    monkeypatch.setattr(progress, "FIRST_LINE", 0.0)
    with progress.working("identifying"):
        while not capsys.readouterr().err.startswith("identifying ..."):
            pass
    with progress.working("identifying"):
        pass


def test_a_long_table_is_read_with_progress(tmp_path, monkeypatch, capsys, clock):
    file = tmp_path / "runs.csv"
    file.write_text("run,slip,load_N\n" + "a,0.2,60\n" * 40_000)
    monkeypatch.setattr(tables, "_LONG", 1000)
    monkeypatch.setattr(progress, "FIRST_LINE", 0.0)
    assert len(read_long_table(str(file), ("run",))) == 40_000
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("reading runs.csv: ")
    with pytest.raises(TableError, match="there is no such file"):
        read_long_table(str(tmp_path / "none.csv"))
