"""Blocks of pages are what their commands print."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import page_ages  # noqa: E402
import pages  # noqa: E402

OUTPUT = "Title\n\nRates by soil, %\n\n soil  rate\n ----  ----\n sand  12.3\n\nEnd\n"
PAGE = "Text.\n\n<!-- output: python x.py | Rates | 2 -->\nold\n<!-- end of output -->\n\nMore.\n"
#: Pages whose commands take seconds; `python tools/pages.py --check` compares all.
QUICK = ("docs/papers/nagatani2009.md",)


def test_a_block_becomes_the_paragraphs_that_its_command_prints():
    written = pages.with_blocks(PAGE, {"python x.py": OUTPUT}.__getitem__)
    assert "```text\nRates by soil, %\n\n soil  rate\n ----  ----\n sand  12.3\n```" in written
    assert written.startswith("Text.\n\n<!-- output: python x.py | Rates | 2 -->\n")
    assert written.endswith("<!-- end of output -->\n\nMore.\n")
    assert pages.with_blocks(written, {"python x.py": OUTPUT}.__getitem__) == written


def test_a_block_without_its_paragraph_is_refused():
    with pytest.raises(SystemExit, match="no paragraph of the output begins with 'Rates'"):
        pages.with_blocks(PAGE, lambda _: "Title\n")


@pytest.mark.parametrize(
    ("now", "same"),
    [
        ("rate 12.3", True),
        ("rate  12.4", True),  # the last digit
        ("rate 13.3", False),
        ("share 12.3", False),
        ("rate 12.3 (4)", False),
    ],
)
def test_pages_agree_up_to_rounding(now, same):
    assert pages.agree("rate 12.3", now) is same


def test_a_stale_page_is_told_and_written(tmp_path, capsys):
    page = tmp_path / "page.md"
    command = "python -c \"print('Rates: 7')\""
    page.write_text(f"<!-- output: {command} | Rates -->\nRates: 5\n<!-- end of output -->\n")
    assert pages.run(["--check", str(page)]) == 1
    assert "stale" in capsys.readouterr().out
    before = page_ages.read_states()
    assert pages.run([str(page)]) == 0
    assert page_ages.read_states() == before  # of another repository
    assert "Rates: 7" in page.read_text()
    assert pages.run(["--check", str(page)]) == 0


def write(root, name, text):
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def state_after(root, name="soilml/physics/model.py", text=None):
    """The state of a script once a file of a small repository has a new text."""
    if text is not None:
        write(root, name, text)
    for cached in (
        page_ages._imported,
        page_ages._tree,
        page_ages._code_hash,
        page_ages._data_hash,
    ):
        cached.cache_clear()
    return page_ages.state_of("python examples/show.py", root)


def test_a_command_is_as_old_as_the_rooms_that_it_reaches(tmp_path):
    write(tmp_path, "examples/show.py", "def run():\n    from soilml.cli import main\n")
    write(tmp_path, "soilml/cli/__init__.py", "from soilml.physics import model\n")
    write(tmp_path, "soilml/physics/model.py", '"""Old."""\nG = 9.81  # m/s^2\n')
    write(tmp_path, "soilml/physics/soils.csv", "c\n1\n")
    write(tmp_path, "soilml/gap/other.py", "x = 1\n")
    then = state_after(tmp_path)
    assert set(then) == {"examples/show.py", "soilml/cli", "soilml/physics"}
    # words, comments and rooms out of reach do not count
    assert state_after(tmp_path, text='"""New."""\n\nG = 9.81\n') == then
    assert state_after(tmp_path, "soilml/gap/other.py", "x = 2\n") == then
    for name, text in (
        ("soilml/physics/model.py", "G = 1.62\n"),
        ("soilml/physics/soils.csv", "2"),
    ):
        now = state_after(tmp_path, name, text)
        assert page_ages.changed_rooms(then, now) == ["soilml/physics"]
        then = now


def test_each_recorded_state_is_of_a_command_of_a_page():
    commands = {c for page in pages.pages() for c in pages.commands_of(page)}
    assert set(page_ages.read_states()) <= commands


@pytest.mark.slow
@pytest.mark.parametrize("page", QUICK)
def test_pages_of_quick_commands_are_not_stale(page):
    assert pages.run(["--check", str(ROOT / page)]) == 0
