"""Steps of a folder are repeated where, and only where, something changed."""

import pytest

from soilml.errors import InputError
from training.adaptation.steps import ResumableSteps


class Work:
    """A step that copies a text into a file and counts its calls."""

    def __init__(self, folder):
        self.folder, self.calls = folder, 0

    def run(self, text="a", fail=False):
        steps = ResumableSteps(self.folder)

        def make():
            self.calls += 1
            (self.folder / "out.txt").write_text(text)
            if fail:
                raise InputError("no")

        steps.run("copy", [text, self.folder / "in.txt"], ["out.txt", "maybe.txt"], make)
        return steps.kept


@pytest.fixture
def work(tmp_path):
    (tmp_path / "in.txt").write_text("input")
    return Work(tmp_path)


def test_a_step_that_is_done_is_kept(work):
    assert work.run() == [] and work.run() == ["copy"]
    assert work.calls == 1


def test_another_input_or_a_changed_output_repeats_it(work):
    work.run()
    work.run("b")
    (work.folder / "in.txt").write_text("other")
    work.run("b")
    (work.folder / "out.txt").write_text("edited")
    work.run("b")
    (work.folder / "out.txt").unlink()
    work.run("b")
    assert work.calls == 5 and work.run("b") == ["copy"]
