"""Every printed number of the source papers is what its row claims."""

import dataclasses
import importlib
import math
import re
from pathlib import Path

import pytest

from soilml.cli import main
from soilml.papers.published import (
    CHAPTERS,
    ORDINAL,
    PAPERS,
    STATUSES,
    Comparison,
    count_statuses,
    printed_numbers,
    read_chapter,
)
from soilml.papers.report import number_report

ROWS = list(printed_numbers())
COLUMNS = (
    *("key", "what", "source", "unit", "published"),
    *("tolerance", "status", "counted_with", "reason"),
)
EVERY = [chapter for name in PAPERS for chapter in CHAPTERS.get(name, (name,))]


#: Comparisons that agree with what the rows claim, without computing.
CLAIMED = [
    Comparison(
        row,
        math.nan if row.compute is None else row.published,
        row.claimed != "missed",
        row.claimed != "depends",
    )
    for row in ROWS
]
PAGE = Path(__file__).parents[2] / "docs/papers/README.md"


@pytest.mark.slow
@pytest.mark.parametrize("paper", dict.fromkeys(row.paper for row in ROWS))
def test_printed_numbers_are_what_their_rows_claim(paper, subtests):
    for row in (row for row in ROWS if row.paper == paper):
        with subtests.test(row.key):
            found = row.compare()
            assert found.status == row.claimed, (
                f"{row.what}: printed {row.published} {row.unit}, computed {found.computed}, "
                f"allowed {row.allowed}, claimed {row.claimed}"
            )


def test_a_row_claims_a_status_and_says_why_it_is_no_result():
    known = {(row.paper, row.key): row for row in ROWS}
    for row in ROWS:
        assert row.claimed in set(STATUSES) - {"wrong"}, row
        assert row.reason or row.claimed in ("reproduced", "given"), row
        assert (row.compute is None) <= (row.claimed in ("not_computed", "given")), row
        # an order or a count keeps under every other open choice, or is no result
        assert row.claimed != "reproduced" or row.unit not in ORDINAL or row.alternatives, row
        if row.counted_with:
            paper, _, key = row.counted_with.rpartition(":")
            assert not known[paper or row.paper, key].counted_with, row


def test_an_order_that_another_choice_turns_round_depends_on_it():
    row = dataclasses.replace(ROWS[0], published=1.0, tolerance=0.0, compute=lambda: 1.0)
    kept = dataclasses.replace(row, claimed="reproduced", alternatives=(lambda: 1.0,))
    turned = dataclasses.replace(kept, alternatives=(lambda: 1.0, lambda: 2.0))
    assert (kept.compare().status, turned.compare().status) == ("reproduced", "depends")


def test_the_page_has_the_counts_of_the_rows():
    """What `soilml paper numbers` printed into the page; it takes too long to run."""
    counts = count_statuses(CLAIMED)
    block = re.search(r"soilml paper numbers \|.*?```text\n(.*?)```", PAGE.read_text(), re.DOTALL)[
        1
    ]
    for code in set(STATUSES) - {"wrong"}:
        said = code.replace("_", " ")
        each = [numbers[code] for numbers in counts.values()]
        line = next(line for line in block.splitlines() if line.startswith(said))
        assert [int(n) for n in line.removeprefix(said).split()] == [*each, sum(each)]


def test_every_chapter_is_complete():
    for chapter in EVERY:
        entries = read_chapter(chapter)
        keys = [entry["key"] for entry in entries]
        assert len(set(keys)) == len(keys), chapter
        assert set(importlib.import_module(f"soilml.papers.{chapter}").COMPUTED) <= set(keys)
        for entry in entries:
            assert tuple(entry) == COLUMNS, chapter
            assert all(entry[name] for name in ("what", "source", "unit", "tolerance")), entry


def test_the_terminal_shows_computed_numbers_and_the_others_by_reason(capsys):
    assert main(["paper", "numbers", "nagatani2009"]) == 0
    short = capsys.readouterr()
    assert main(["paper", "numbers", "nagatani2009", "-v"]) == 0
    every = capsys.readouterr()
    rows = [row for row in ROWS if row.paper == "nagatani2009"]
    # a long text goes on in the next line of its column
    whole, some = (" ".join(found.out.split()) for found in (every, short))
    computed = [row for row in rows if row.claimed not in ("given", "not_computed")]
    assert all(f"{row.what} ({row.source})" in some for row in computed)
    assert all(row.reason in whole for row in rows if row.claimed != "given")
    given = [row for row in rows if row.claimed == "given"]
    assert f"{len(given)} given, kept as printed: wheel radius, " in whole


def test_the_report_of_all_papers_counts_what_rows_claim():
    report = number_report(CLAIMED)
    assert report.verdict.startswith("5 of 346 printed numbers") and report.tone == "good"
    assert len(report.tables) == 1 + len(PAPERS)
    wrong = number_report([*CLAIMED, dataclasses.replace(CLAIMED[0], agrees=False)])
    assert wrong.tone == "bad" and "first radius" in wrong.verdict
