"""The verdict in words and what these runs do not support: short, in order, alike everywhere."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
from gap_sets import analysed, case_of, hidden, remark

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan
from soilml.config.measurement_noise import Discrepancy
from soilml.gap import STATUSES, gap
from soilml.gap.results import (
    GapReduction,
    GapReport,
    NamedEffect,
    NextRun,
    RemainderCause,
    RemainingDiscrepancy,
    Suspect,
)
from soilml.gap.sentences import (
    HEADLINE_WORDS,
    headline,
    next_run_in_words,
    report_lines,
    short_reason,
)
from soilml.io.table import Table
from soilml.remarks import Remark, texts
from soilml.report.report import MOST_LINES

SENTENCE_WORDS, REASON_WORDS = 30, 14
FIGURES = {"train": GapReduction(8.8, 1.1, {}, 96, "all rows fitted")}
LEFT = {
    "sinkage_m": RemainingDiscrepancy("m", 0.004, 0.0021, 4.0, 0.3, ""),
    "drawbar_pull_N": RemainingDiscrepancy("N", 4.0, 2.5, 4.0, 1.26, ""),
    "torque_Nm": RemainingDiscrepancy("N m", 4.0, 2.5, 4.0, 0.29, ""),
}
REMAINDER = (
    "A smooth discrepancy is left beside {}. Its root mean square: sinkage 2.1 mm (0.30 sigma), "
    "drawbar pull 2.5 N (1.3 sigma)."
)


def report(status, **parts):
    parts = {"gap": FIGURES, "gap_probability": 0.123} | parts
    return GapReport(status, "", parts.pop("model", case_of()), **parts)


def effect(name, probability=0.912):
    return SimpleNamespace(name=name, probability=probability)


def said(status, **parts):
    return headline(report(status, **parts))


def lines(status, present=(), **parts):
    return {line.code: line.text for line in report_lines(report(status, **parts), present)}


def test_agreement_is_within_the_noise_and_what_counts_as_noise():
    expected = "mean squared residual 8.80, probability of a gap 0.12."
    begin = "Model and measurements agree within the noise"
    assert said("no-gap") == f"{begin}: {expected}"
    declared = replace(case_of(), discrepancy={"torque_Nm": Discrepancy(share=0.02)})
    assert said("no-gap", model=declared) == f"{begin} and declared discrepancy: {expected}"
    learned = {"torque_Nm": Discrepancy(constant=0.02, learned=True)}
    assert said("no-gap", model=replace(case_of(), discrepancy=learned)) == f"{begin}: {expected}"
    scatter = {"friction_angle_std": 0.0105, "bearing_std": 0.06}
    scattering = "0.60 deg of scatter between runs"
    alone = said("no-gap", variance_components=scatter)
    assert alone == f"{begin} and {scattering}: {expected}"
    both = said("no-gap", variance_components=scatter, model=declared)
    assert both == f"{begin}, declared discrepancy and {scattering}: {expected}"
    assert len(both.split()) <= HEADLINE_WORDS


def test_what_was_tried_is_told_with_what_was_left_out():
    assert lines("no-gap")["tried"] == "The soil alone was fitted."
    outliers = Remark("outliers", "...", ("torque_Nm at line 3", "sinkage_m at line 4"))
    assert lines("no-gap", misfit=2.89, notes=(outliers,))["tried"] == (
        "2 readings are outliers and were excluded. Residuals are 1.7 times the declared noise by "
        "the soil alone."
    )
    one = replace(outliers, about=outliers.about[:1])
    assert lines("no-gap", notes=(one,))["tried"] == "1 reading is an outlier and was excluded."


def test_without_a_cause_the_first_reason_is_stated():
    reasons = (Remark("one-load", "there is one load only: 40 N in run_a"), remark("runs differ"))
    assert said("undecided", reasons=reasons).endswith("was found, but there is one load only.")
    assert said("not-testable", reasons=reasons).endswith("its cause: there is one load only.")
    unknown = said("unknown", reasons=reasons, discrepancy=LEFT)
    assert "no effect explains better than a smooth error (mean squared residual 8.80" in unknown
    small = {"train": GapReduction(1.2, 1.2, {}, 96, "all rows fitted")}
    assert "(residuals form a pattern that noise does not; " in said("unknown", gap=small)
    found = lines("unknown", reasons=reasons, discrepancy=LEFT)
    assert found["why"] == "Why no cause is named: there is one load only; runs differ."
    assert found["left"] == REMAINDER.format("the soil alone")
    assert "left" not in lines("unknown", discrepancy={"torque_Nm": LEFT["torque_Nm"]})


def test_what_is_left_says_beside_which_explanation_and_what_its_cause_is_like():
    worst = replace(LEFT["drawbar_pull_N"], description="measured above the model by up to 5.0 N")
    suspects = (Suspect(("a", "b"), 0.0, 0.5),)
    parts = {"suspects": suspects, "cause_set": (("a", "b"),)}
    parts |= {"discrepancy": LEFT | {"drawbar_pull_N": worst}}
    cause = RemainderCause("shear stress", "slip", 0.95, 2.0)
    depends = (
        "The remainder beside {} looks like a change of the shear stress that depends on slip."
    )
    assert lines("suspected", **parts, remainder_cause=cause)["left"] == (
        f"{REMAINDER.format('a + b')} Drawbar pull is measured above the model by up to 5.0 N. "
        f"{depends.format('the soil alone')}"
    )
    named = {"effects": (effect("dig"),), "cause_set": (("dig",),), "discrepancy": LEFT}
    named["remainder_cause"] = replace(cause, beside=("dig",))
    assert lines("named", **named)["left"] == (f"{REMAINDER.format('dig')} {depends.format('dig')}")
    assert lines("named", **named | {"discrepancy": {}})["left"] == depends.format("dig")


def test_suspects_have_their_probabilities_and_the_first_three_are_listed():
    chances = {"a": 0.86, "b": 0.45, "c": 0.24, "d": 0.1}
    suspects = tuple(Suspect((n,), 0.0, p) for n, p in chances.items())
    assert said("suspected", suspects=suspects, cause_set=(("a",),)) == (
        "Cause not certain: first suspect is a (probability 0.86); the gap shrinks 8.80 -> 1.10."
    )
    found = lines("suspected", suspects=suspects)
    begin = "Suspects, the likeliest first, with their probabilities:"
    assert found["suspects"] == f"{begin} a (0.86); b (0.45); c (0.24)."
    bound = (suspects[0], replace(suspects[1], probability=0.0049))
    assert lines("suspected", suspects=bound)["suspects"] == f"{begin} a (0.86)."
    assert "suspects" not in lines("suspected", suspects=bound[1:])


@pytest.mark.parametrize("outside, stated", [(0.049, False), (0.24, True)])
def test_a_cause_outside_the_catalogue_has_its_probability(outside, stated):
    sets = {"effects": (effect("dig"),), "cause_set": (("dig",), ("rate",))}
    suspect = {"suspects": (Suspect(("a",), 0.0, 0.5),)}
    for status, parts in (("class", sets), ("suspected", suspect), ("unknown", {})):
        text = lines(status, **parts, outside_probability=outside).get("suspects", "")
        assert text.endswith("Probability that the catalogue lacks the cause: 0.24.") == stated


def test_explanations_by_what_is_claimed():
    parts = {"effects": (effect("dig"), effect("plough", 0.95)), "discrepancy": LEFT}
    shrinks = "(probability 0.91); the gap shrinks 8.80 -> 1.10."
    assert said("named", **parts) == f"Missing effect: dig + plough {shrinks}"
    assert said("partly-named", **parts) == f"Missing effect, among others: dig + plough {shrinks}"
    assert said("form-open", **parts) == (
        f"Missing effect: dig + plough, by another law than the catalogue's {shrinks}"
    )
    sets = (("dig",), ("plough", "rate"))
    alone = {"effects": (effect("dig"),), "cause_set": sets}
    assert said("class", **alone) == (
        f"Missing effect: one of 2 explanations, likeliest dig {shrinks}"
    )
    assert lines("class", **alone)["suspects"].endswith("first: dig, or plough + rate.")
    many = {"effects": (effect("dig"),), "cause_set": tuple((f"e{i}",) for i in range(13))}
    listed = lines("class", **many)["suspects"]
    assert listed.endswith("e0, or e1, or e2, or 10 others.")
    assert lines("named", ["dig"], **parts)["tried"] == "The model has dig at another size."
    slight = {"train": GapReduction(8.8, 8.5, {}, 96, "all rows fitted")}
    assert said("named", **parts, gap=slight).endswith("; the gap hardly shrinks 8.80 -> 8.50.")


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
    remarks = (*report.lines, *report.notes, *report.reasons)
    sentences = [longest(r.text) for r in remarks if LONG not in r.text]
    assert [own for own in sentences if len(own.split()) > SENTENCE_WORDS] == []
    assert all(len(short_reason(r).split()) <= REASON_WORDS for r in report.reasons)


def check_order(report):
    chances = [s.probability for s in report.suspects]
    assert chances == sorted(chances, reverse=True)
    known = report.probabilities
    if report.status == "class" and all(len(names) == 1 for names in report.cause_set):
        chances = [known[names[0]] for names in report.cause_set]
        assert chances == sorted(chances, reverse=True)
    if report.status == "suspected" and report.suspects:
        assert report.first == report.suspects[0].effects


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


LONG = "of sinkage_m, run_a and run_b differ " + "very " * 30 + "much"
PARTS = {
    "gap": {"train": GapReduction(1234.5, 123.4, {}, 96, "all rows fitted")},
    "reasons": (Remark("strange", f"channels differ: {LONG}"), Remark("other", f"so: {LONG}")),
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


@pytest.mark.parametrize(
    "compared, sigma, said",
    [
        ("ab", 12.0, "a from b by 10 or more sigma."),
        ("abc", 3.0, "a from b and 1 other by 3.0 sigma."),
        ("abcd", 3.0, "a from b and 2 others by 3.0 sigma."),
    ],
)
def test_the_next_run_says_what_it_separates(compared, sigma, said):
    run = NextRun("heavier", "210 N", sigma, (), tuple((name,) for name in compared))
    assert next_run_in_words(run) == f"Next: heavier (210 N). It separates {said}"
