"""Every printed number of the source papers is reproduced, or said not to be."""

import csv
import importlib
from importlib import resources

import pytest

from soilml.cli import main
from soilml.papers import PAPERS, TITLES
from soilml.papers.published import COLUMNS, printed_numbers

ROWS = list(printed_numbers())
CHAPTERS = [chapter for chapters in PAPERS.values() for chapter in chapters]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.paper}-{row.key}")
def test_a_printed_number_is_reproduced_or_said_not_to_be(row):
    found = row.compared()
    assert found.honest, (
        f"{row.what}: printed {row.published} {row.unit}, computed {found.computed}, allowed "
        f"{row.allowed}, reason {row.reason!r}"
    )


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_chapter_is_whole(chapter):
    text = resources.files("soilml.papers").joinpath(f"{chapter}.csv").read_text("utf-8")
    entries = list(csv.DictReader(text.splitlines()))
    keys = [entry["key"] for entry in entries]
    assert len(set(keys)) == len(keys)
    assert set(importlib.import_module(f"soilml.papers.{chapter}").COMPUTED) <= set(keys)
    for entry in entries:
        assert tuple(entry) == COLUMNS
        assert entry["what"] and entry["source"] and entry["unit"] and entry["tolerance"]


def test_every_paper_has_a_title():
    assert set(TITLES) == set(PAPERS)


def test_an_input_that_is_kept_counts_as_no_result():
    kept = [row.compared() for row in ROWS if row.given]
    assert {one.said for one in kept} == {"given"}
    assert all(abs(one.computed - one.row.published) <= 0.01 for one in kept)


def test_a_person_sees_what_is_computed_and_the_rest_by_reason(monkeypatch, capsys):
    monkeypatch.setattr("soilml.cli.commands.papers.is_terminal", lambda: True)
    assert main(["papers", "nagatani2009"]) == 0
    short = capsys.readouterr()
    assert main(["papers", "nagatani2009", "--all"]) == 0
    every = capsys.readouterr()
    rows = [row for row in ROWS if row.paper == "nagatani2009"]
    assert all(f"{row.what} ({row.source})" in every.out for row in rows)
    computed = [row for row in rows if row.compute is not None and not row.given]
    assert all(f"{row.what} ({row.source})" in short.out for row in computed)
    kept, rest = sum(row.given for row in rows), sum(row.compute is None for row in rows)
    assert f"{kept} given, kept as printed: wheel radius, " in short.out
    assert f"{kept} inputs kept as printed; {rest} not computed" in short.err
