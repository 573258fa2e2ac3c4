"""Files are whole or not there."""

import errno

import pytest

from soilml.errors import InputError
from soilml.saving import replacing, save_text


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "out.csv"
    target.write_text("old")
    with pytest.raises(RuntimeError), replacing(target) as part:
        part.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_what_a_killed_process_left_is_overwritten(tmp_path):
    target = tmp_path / "out.csv"
    with replacing(target) as part:
        part.write_text("whole")
        left_behind = part
    target.unlink()
    left_behind.write_text("half of something long")
    save_text(target, "new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    target = tmp_path / "out.csv"
    with pytest.raises(InputError, match="No space left"), replacing(target) as part:
        part.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        save_text(tmp_path / "nowhere" / "out.csv", "")
    with pytest.raises(InputError, match="is a folder"):
        save_text(tmp_path, "")
