"""Every printed number of the source papers is reproduced, or said not to be."""

import csv
import importlib
from importlib import resources

import pytest

from soilml.papers import PAPERS, TITLES
from soilml.papers.published import COLUMNS, published

ROWS = list(published())
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
