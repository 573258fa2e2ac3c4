"""Files are whole or not there."""

import errno
import os
import stat

import pytest

from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output, atomic_outputs, create_folder, save_text


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "out.csv"
    target.write_text("old")
    with pytest.raises(RuntimeError), atomic_output(target) as part:
        part.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_two_writers_of_one_file_do_not_mix(tmp_path):
    target = tmp_path / "out.csv"
    with atomic_output(target) as first, atomic_output(target) as second:
        first.write_text("the first, and long")
        second.write_text("the second")
    assert target.read_text() == "the first, and long"
    assert list(tmp_path.iterdir()) == [target]


def test_several_files_are_replaced_together_or_not_at_all(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("old")
    with pytest.raises(InputError, match="two"), atomic_outputs([one, two]) as (first, _):
        first.write_text("new")  # the second is never written
    assert one.read_text() == "old"
    two.mkdir()
    with pytest.raises(InputError, match="is a folder"), atomic_outputs([one, two]):
        pytest.fail("begun though the second cannot be written")
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    real, link = tmp_path / "real" / "out.csv", tmp_path / "link.csv"
    real.write_text("old")
    link.symlink_to(real)
    save_text(link, "new")
    assert link.is_symlink() and real.read_text() == "new"


def test_what_is_no_file_is_left_alone(tmp_path):
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="pipe"):
        save_text(pipe, "new")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InputError, match="symbolic links"):
        save_text(tmp_path / "loop", "new")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_name_as_long_as_the_disk_takes_can_be_written(tmp_path):
    target = tmp_path / ("ä" * 125 + ".csv")
    save_text(target, "new")
    assert target.read_text() == "new"
    with pytest.raises(InputError, match="File name too long"):
        save_text(tmp_path / ("x" * 256), "new")


def test_a_folder_made_for_nothing_goes_again(tmp_path):
    with pytest.raises(RuntimeError), create_folder(tmp_path / "a" / "b"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    with create_folder(tmp_path / "a" / "b") as folder:
        assert folder.is_dir()
    with pytest.raises(RuntimeError), create_folder(folder):
        raise RuntimeError
    assert folder.is_dir()
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(InputError, match="file cannot be created"),
        create_folder(tmp_path / "file"),
    ):
        pass


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    target = tmp_path / "out.csv"
    with pytest.raises(InputError, match="No space left"), atomic_output(target) as part:
        part.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        save_text(tmp_path / "nowhere" / "out.csv", "")
    with pytest.raises(InputError, match="is a folder"):
        save_text(tmp_path, "")
