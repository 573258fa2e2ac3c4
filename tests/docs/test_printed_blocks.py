"""Blocks of pages are what their commands print."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))

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
    assert pages.run([str(page)]) == 0
    assert "Rates: 7" in page.read_text()
    assert pages.run(["--check", str(page)]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("page", QUICK)
def test_pages_of_quick_commands_are_not_stale(page):
    assert pages.run(["--check", str(ROOT / page)]) == 0
