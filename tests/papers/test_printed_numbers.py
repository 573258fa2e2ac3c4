"""Every printed number of the source papers is reproduced, or states why it is not."""

import csv
import importlib
import sys
from importlib import resources

import pytest

from soilml.cli import main
from soilml.papers.published import COLUMNS, PAPERS, chapters, printed_numbers

ROWS = list(printed_numbers())
CHAPTERS = [chapter for name in PAPERS for chapter in chapters(name)]


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.paper}-{row.key}")
def test_a_printed_number_is_reproduced_or_has_a_reason(row):
    found = row.compare()
    assert found.reproduced != bool(found.row.reason), (
        f"{row.what}: printed {row.published} {row.unit}, computed {found.computed}, allowed "
        f"{row.allowed}, reason {row.reason!r}"
    )


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_chapter_is_complete(chapter):
    text = resources.files("soilml.papers").joinpath(f"{chapter}.csv").read_text("utf-8")
    entries = list(csv.DictReader(text.splitlines()))
    keys = [entry["key"] for entry in entries]
    assert len(set(keys)) == len(keys)
    assert set(importlib.import_module(f"soilml.papers.{chapter}").COMPUTED) <= set(keys)
    for entry in entries:
        assert tuple(entry) == COLUMNS
        assert entry["what"] and entry["source"] and entry["unit"] and entry["tolerance"]


def test_an_input_is_not_counted_as_a_result():
    kept = [row.compare() for row in ROWS if row.is_input]
    assert {one.verdict for one in kept} == {"given"}
    assert all(abs(one.computed - one.row.published) <= 0.01 for one in kept)


def test_the_terminal_shows_computed_numbers_and_the_others_by_reason(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main(["papers", "nagatani2009"]) == 0
    short = capsys.readouterr()
    assert main(["papers", "nagatani2009", "--all"]) == 0
    every = capsys.readouterr()
    rows = [row for row in ROWS if row.paper == "nagatani2009"]
    # a long text goes on in the next line of its column
    whole, some = (" ".join(found.out.split()) for found in (every, short))
    assert all(f"{row.what} ({row.source})" in whole for row in rows)
    computed = [row for row in rows if row.compute is not None and not row.is_input]
    assert all(f"{row.what} ({row.source})" in some for row in computed)
    kept, rest = sum(row.is_input for row in rows), sum(row.compute is None for row in rows)
    assert f"{kept} given, kept as printed: wheel radius, " in short.out
    assert f"{kept} inputs kept as printed; {rest} not computed" in short.err
