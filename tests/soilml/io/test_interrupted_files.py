"""A set of files is replaced as one, whatever stops or kills the process."""

import json
import os
import signal
import subprocess
import sys

import pytest

from soilml.errors import InputError
from soilml.io.atomic_files import atomic_outputs, save_text

#: Writes two files; the named moment of the exchange then sends the named signal to the process.
WRITER = """
import os, signal, sys
from pathlib import Path
from soilml.cli.process import StopSignals
from soilml.io import atomic_files
from soilml.io.atomic_files import atomic_outputs
folder, number, after = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if number != signal.SIGKILL:
    signal.signal(number, signal.SIG_DFL)  # nohup, or a shell's background, ignores some
replace, done = Path.replace, []
def replace_and_signal(part, target):
    if len(done) == after:
        os.kill(os.getpid(), number)
    done.append(target)
    return replace(part, target)
Path.replace = replace_and_signal
with StopSignals():
    with atomic_outputs([f"{folder}/one", f"{folder}/two"], remove=[f"{folder}/old"]) as parts:
        for part in parts:
            part.write_text("new")
        if after < 0:
            os.kill(os.getpid(), number)
"""


def write(folder, number, after):
    words = [sys.executable, "-c", WRITER, folder, int(number), after]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run([str(w) for w in words], env=environment, capture_output=True, text=True)


@pytest.fixture
def folder(tmp_path):
    for name in ("one", "two", "old"):
        (tmp_path / name).write_text("before")
    return tmp_path


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_between_two_renames_waits_until_the_set_is_complete(folder, number):
    done = write(folder, number, 1)
    assert done.returncode != 0
    assert contents(folder) == {"one": "new", "two": "new"}


@pytest.mark.parametrize("after", [0, 1])
def test_what_a_kill_between_two_renames_left_is_finished_by_the_next_writer(folder, after):
    assert write(folder, signal.SIGKILL, after).returncode == -signal.SIGKILL
    assert any(path.suffix == ".journal" for path in folder.iterdir())
    with pytest.raises(RuntimeError), atomic_outputs([folder / "one", folder / "two"]):
        raise RuntimeError  # the next writer fails; the set of the one before is whole all the same
    assert contents(folder) == {"one": "new", "two": "new"}


def test_what_a_kill_before_the_exchange_left_is_cleared(folder):
    assert write(folder, signal.SIGKILL, -1).returncode == -signal.SIGKILL
    assert len(contents(folder)) > 3
    save_text(folder / "one", "again")
    assert contents(folder) == {"one": "again", "two": "before", "old": "before"}


def test_the_files_of_a_living_writer_are_left_alone(folder):
    with atomic_outputs([folder / "one"]) as (part,):
        part.write_text("first")
        assert write(folder, signal.SIGCONT, -1).returncode == 0
        assert part.read_text() == "first" and (folder / "one").read_text() == "new"
    assert contents(folder) == {"one": "first", "two": "new"}


def test_a_journal_that_names_other_files_is_not_followed(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "target"
    other.write_text("safe")
    (folder / ".one.part").write_text("hostile")
    for moves in ([[str(folder / ".one.part"), str(other)]], [[str(other), str(folder / "one")]]):
        text = json.dumps({"moves": moves, "remove": [str(other)]}) + "\ncomplete\n"
        (folder / ".one.0123abcd.journal").write_text(text)
        save_text(folder / "one", "new")
        assert other.read_text() == "safe" and (folder / "one").read_text() == "new"


@pytest.mark.parametrize("text", ["", "{", "[]\n", "{}\ncomplete\n", '{"moves": 3}\n'])
def test_a_damaged_journal_stops_nobody(folder, text):
    (folder / ".one.0123abcd.journal").write_text(text)
    save_text(folder / "one", "new")
    assert (folder / "one").read_text() == "new"


def test_permissions_are_kept_and_a_read_only_file_is_not_replaced(folder):
    (folder / "one").chmod(0o600)
    save_text(folder / "one", "new")
    assert (folder / "one").stat().st_mode & 0o777 == 0o600
    (folder / "one").chmod(0o444)
    with pytest.raises(InputError, match="read-only"):
        save_text(folder / "one", "newer")
    assert (folder / "one").read_text() == "new"
