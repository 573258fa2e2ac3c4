"""A report says the same everywhere: a short headline, few lines, and suspects by probability."""

import re
from dataclasses import replace

import pytest
from gap_sets import analysed, case_of, driven, hidden

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan
from soilml.gap import STATUSES, gap
from soilml.gap.results import (
    GapReduction,
    GapReport,
    NamedEffect,
    NextRun,
    Suspect,
)
from soilml.gap.sentences import (
    HEADLINE_WORDS,
    MOST_LINES,
    SENTENCE_WORDS,
    headline,
    next_run_in_words,
    report_lines,
)
from soilml.io.table import Table
from soilml.remarks import Remark, texts

STORIES = {
    "torque-sensor": Plan("S", "torque-gain", 1.0, 0.01, 8, "dry-sand", 3, seed=3),
    "nothing": Plan("N0", "", 0.0, 0.01, 8, "dry-sand", 3, seed=4),
    "unknown": Plan("C", "stiff-layer", 1.0, 0.01, 8, "dry-sand", 3, seed=5),
}


def longest(text):
    """The longest sentence of a text."""
    return max(re.split(r"(?<=[.?!]) (?=[A-Z0-9])", text), key=lambda own: len(own.split()))


def check_words(report, runs):
    words = report.sentence.replace("\N{NO-BREAK SPACE}", " ").split()
    assert 3 < len(words) <= HEADLINE_WORDS, report.sentence
    assert len(report.lines) <= MOST_LINES
    named = [n for text in (report.sentence, *texts(report.lines)) for n in runs if n in text]
    assert not named
    remarks = (*report.lines, *report.notes, *report.reasons, *report.conditions)
    sentences = [longest(r.text) for r in remarks if r.text != LONG]
    assert [own for own in sentences if len(own.split()) > SENTENCE_WORDS] == []


def check_order(report):
    chances = [s.probability for s in report.suspects]
    assert chances == sorted(chances, reverse=True)
    known = report.probabilities
    if report.status == "class" and all(len(names) == 1 for names in report.cause_set):
        chances = [known[names[0]] for names in report.cause_set]
        assert chances == sorted(chances, reverse=True)
    if report.status == "suspected" and report.suspects:
        assert report.best_unclaimed == report.suspects[0].effects


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_stories_are_told_shortly_and_alike_everywhere(name):
    drawn = draw_blind_set(replace(STORIES[name]))
    report = gap(case_of(drawn.model), Table(dict(drawn.columns)))
    check_words(report, set(drawn.columns["run"]))
    check_order(report)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["scatter", "slip-sinkage", "bulldozing", "exit-angle"])
def test_reports_on_sealed_sets_are_short_and_in_order(kind):
    _, table, _, _ = hidden(kind)
    check_words(analysed(kind), set(table["run"]))
    check_order(analysed(kind))


@pytest.mark.slow
def test_torque_alone_says_what_could_hide_in_it():
    case = case_of()
    table = driven(case)
    columns = {n: table[n] for n in ("run", "slip", "load_N", "torque_Nm")}
    report = gap(case, Table(columns))
    assert report.status == "no-gap"
    (note,) = [line for line in report.lines if line.code == "hidden-effect"]
    assert note.about[0] in note.text and "would change drawbar pull by" in note.text


LONG = "of sinkage_m, run_a and run_b differ " + "very " * 30 + "much"
PARTS = {
    "gap": {"train": GapReduction(1234.5, 123.4, {}, 96, "all rows fitted")},
    "reasons": (Remark("strange", LONG), Remark("other", LONG)),
    "best_unclaimed": ("lateral-slip@first", "load-transfer@first", "stress-shift"),
    "suspects": (
        Suspect(("lateral-slip@first", "load-transfer@first", "stress-shift"), 1.0, 0.66),
        Suspect(("grousers",), 0.0, 0.45),
    ),
    "cause_set": (("a", "b", "c"), ("d",)),
    "effects": tuple(NamedEffect(n, {}, (), 0.9, 2.0) for n in ("a", "b", "c")),
    "notes": (Remark("outliers-matter", "the verdict depends on 3 excluded readings"),),
}


@pytest.mark.parametrize("status", STATUSES)
def test_the_longest_names_leave_the_headline_short(status):
    report = GapReport(status, "", case_of(), **PARTS)
    report = replace(report, sentence=headline(report), lines=report_lines(report))
    check_words(report, {"run_a", "run_b"})


def test_many_lines_leave_room_for_the_next_run():
    notes = tuple(Remark("hidden-effect", f"note {i}") for i in range(9))
    run = NextRun("heavier", "210 N", 3.2, (), 2.0, (("a",), ("b", "c")))
    report = GapReport(
        "suspected", "", case_of(), **(PARTS | {"notes": notes, "next_runs": (run,)})
    )
    found = report_lines(report)
    assert len(found) == MOST_LINES and found[-1].code == "next"
    assert "tried" not in {line.code for line in found}
    assert found[-1].text == (
        "Next: heavier (210 N), which separates a from b + c by 3.2 sigma at a cost of 2."
    )


@pytest.mark.parametrize(
    "compared, sigma, said",
    [
        ("ab", 12.0, "which separates a from b by 10 or more sigma."),
        ("abc", 3.0, "which separates a from b and 1 other by 3.0 sigma on average."),
        ("abcd", 3.0, "which separates a from b and 2 others by 3.0 sigma on average."),
    ],
)
def test_the_next_run_says_what_it_separates(compared, sigma, said):
    run = NextRun("heavier", "210 N", sigma, (), None, tuple((name,) for name in compared))
    assert next_run_in_words(run) == f"Next: heavier (210 N), {said}"
    long = replace(run, text="very " * 20 + "heavy")
    assert next_run_in_words(long).endswith(f"heavy). This {said[6:]}")
