"""The verdict in words and what it does not support: short, in order, alike everywhere."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import analysed, case_of, driven, hidden, remark
from remarked import remarked

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan
from soilml.config.measurement_noise import Discrepancy
from soilml.gap import STATUSES, gap
from soilml.gap.conclusions import unsupported_conclusions
from soilml.gap.results import (
    GapReduction,
    GapReport,
    NamedEffect,
    NextRun,
    NoiseAgreement,
    RemainderCause,
    RemainingDiscrepancy,
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


SCATTER = NoiseAgreement(2.89, True, 0.81, float(np.radians(0.6)), 0.06)


def test_agreement_is_within_the_noise_and_what_was_declared():
    expected = "agree within the noise: mean squared residual 8.8, probability of a gap 0.12."
    assert said("no-gap").endswith(expected)
    declared = replace(case_of(), discrepancy={"torque_Nm": Discrepancy(share=0.02)})
    assert "within the noise and the declared discrepancy:" in said("no-gap", model=declared)
    learned = {"torque_Nm": Discrepancy(constant=0.02, learned=True)}
    assert said("no-gap", model=replace(case_of(), discrepancy=learned)).endswith(expected)
    found = said("no-gap", model=replace(case_of(), discrepancy=learned), misfit=SCATTER)
    assert found.startswith("No gap beyond noise, with a scatter")


def test_granted_scatter_is_named_with_its_size():
    granted = "a scatter of 0.60 deg and 6 % from run to run"
    assert said("no-gap", misfit=SCATTER) == (
        f"No gap beyond noise, with {granted}: probability of a gap 0.12."
    )
    assert lines("no-gap", misfit=SCATTER)["tried"] == (
        f"Residuals are 1.7 times the declared noise by the soil alone, 0.9 times with {granted}."
    )
    outliers = Remark("outliers", "...", ("torque_Nm at line 3", "sinkage_m at line 4"))
    without = lines("no-gap", misfit=SCATTER, notes=(outliers,))["tried"]
    assert without.startswith(
        "2 readings are outliers and were excluded. Without them, residuals are 1.7 times"
    )
    one = replace(outliers, about=outliers.about[:1])
    assert lines("no-gap", notes=(one,))["tried"] == "1 reading is an outlier and was excluded."
    larger = replace(SCATTER, granted=3.0)  # scatter does not make residuals larger
    assert "scatter" not in lines("no-gap", misfit=larger)["tried"]
    none = replace(SCATTER, friction_angle_std=0.0, bearing_std=0.0)
    assert "scatter" not in said("no-gap", misfit=none)
    assert "scatter" not in lines("no-gap", misfit=none)["tried"]


def test_without_a_cause_the_first_reason_is_stated():
    reasons = (Remark("one-load", "all rows have the load 40 N in run_a"), remark("runs differ"))
    assert said("undecided", reasons=reasons).endswith("disagree: there is one load only.")
    assert said("not-testable", reasons=reasons).endswith("its cause: there is one load only.")
    unknown = said("unknown", reasons=reasons, best_unclaimed=("a", "b"), discrepancy=LEFT)
    assert "no effect explains better than a smooth error (mean squared residual 8.80" in unknown
    found = lines("unknown", reasons=reasons, discrepancy=LEFT)
    assert found["why"] == "Why no cause is named: there is one load only; runs differ."
    assert found["left"] == REMAINDER.format("the soil alone")
    assert "left" not in lines("unknown", discrepancy={"torque_Nm": LEFT["torque_Nm"]})


def test_what_is_left_says_beside_which_explanation_and_what_its_cause_is_like():
    worst = replace(LEFT["drawbar_pull_N"], description="measured above the model by up to 5.0 N")
    suspects = (Suspect(("a", "b"), 0.0, 0.5),)
    parts = {"suspects": suspects, "best_unclaimed": ("a", "b")}
    parts |= {"discrepancy": LEFT | {"drawbar_pull_N": worst}}
    cause = RemainderCause("shear stress", "slip", 0.95, 2.0)
    depends = (
        "The remainder beside {} looks like a change of the shear stress that depends on slip."
    )
    assert lines("suspected", **parts, remainder_cause=cause)["left"] == (
        f"{REMAINDER.format('a + b')} Drawbar pull is measured above the model by up to 5.0 N. "
        f"{depends.format('the soil alone')}"
    )
    named = {"effects": (effect("dig"),), "discrepancy": LEFT}
    named["remainder_cause"] = replace(cause, beside=("dig",))
    assert lines("named", **named)["left"] == (f"{REMAINDER.format('dig')} {depends.format('dig')}")
    assert lines("named", **named | {"discrepancy": {}})["left"] == depends.format("dig")


@pytest.mark.parametrize(
    "code, about, words",
    [
        ("other-law", ("dig",), "the law of dig differs from the catalogue's"),
        ("implausible-size", ("a", "b"), "a + b would have to be implausibly large"),
        (
            "not-catalogued",
            ("a", "b", "drawbar_pull_N"),
            "a large discrepancy of drawbar pull is left beside a + b",
        ),
        (
            "not-predictive",
            ("dig",),
            "beside a smooth remainder, dig predicts rows kept back no better than the soil alone",
        ),
        ("implausible-fault", ("gain",), "gain would be an implausibly large fault"),
    ],
)
def test_a_reason_names_the_explanation_that_it_is_about(code, about, words):
    reasons = (Remark(code, "...", about),)
    assert lines("suspected", reasons=reasons)["why"] == f"Why no cause is named: {words}."


def test_residuals_beyond_the_noise_are_no_disagreement_of_measurements():
    misfit = NoiseAgreement(6.25, True, 6.25, 0.0, 0.0)
    excess = Remark("excess-residuals", "residuals are 2.5 times the declared noise")
    assert said("undecided", misfit=misfit, reasons=(excess, remark("runs differ"))) == (
        "Residuals are 2.5 times the declared noise; these rows cannot tell a gap from understated "
        "noise."
    )
    assert "disagree" in said("undecided", misfit=misfit, reasons=(remark("runs differ"), excess))
    pressed = Remark("soil-at-prior", "n at 1.4, the upper end of its prior", ("n",))
    assert said("undecided", misfit=misfit, reasons=(pressed,)) == (
        "Residuals are 2.5 times the declared noise, with the soil at ends of its priors: widen "
        "them, or model or noise is wrong."
    )


def test_an_implausibly_large_fault_is_named_in_the_headline():
    fault = Remark("implausible-fault", "...", ("drawbar-offset",))
    assert said("unknown", reasons=(fault,)) == (
        "There is a gap, which only an implausibly large drawbar-offset explains (mean squared "
        "residual 8.80; noise alone gives 1; probability 0.12)."
    )


def test_suspects_have_their_probabilities_and_the_first_three_are_listed():
    chances = {"a": 0.86, "b": 0.45, "c": 0.24, "d": 0.1}
    suspects = tuple(Suspect((n,), 0.0, p) for n, p in chances.items())
    assert said("suspected", suspects=suspects) == (
        "Cause not certain: first suspect is a (probability 0.86); the gap shrinks 8.80 -> 1.10."
    )
    found = lines("suspected", suspects=suspects)
    begin = "Suspects, the likeliest first, with their probabilities:"
    assert found["suspects"] == f"{begin} a (0.86); b (0.45); c (0.24)."
    assert found["why"].endswith("the evidence is not decisive.")
    bound = (suspects[0], replace(suspects[1], probability=0.0049))
    assert lines("suspected", suspects=bound)["suspects"] == f"{begin} a (0.86)."
    assert "suspects" not in lines("suspected", suspects=bound[1:])
    large = (Suspect(("b", "c"), -1.3, 0.2, times_usual={"c": 5.93}),)
    assert "first suspect is b + c (probability 0.20, implausibly large)" in said(
        "suspected", suspects=large
    )
    assert lines("suspected", suspects=large)["suspects"].endswith(
        "b + c (0.20). The first needs c at 5.9 times its usual size."
    )


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
    assert listed.endswith("e9, or 3 others.") and len(listed.split()) == 29
    assert lines("named", ["dig"], **parts)["tried"] == "The model has dig at another size."
    slight = {"train": GapReduction(8.8, 8.5, {}, 96, "all rows fitted")}
    assert said("named", **parts, gap=slight).endswith("; the gap hardly shrinks 8.80 -> 8.50.")


def concluded(status, obstacles=(), fixed=(), **parts):
    given = report(status, **parts)
    return texts(unsupported_conclusions(given, [remark(text) for text in obstacles], fixed))


SMALLER = "that a smaller gap proves a cause: wrong effects reduce the gap too"


def test_an_all_clear_is_no_proof():
    complete = "that the model is complete: these runs merely show no disagreement"
    assert concluded("no-gap", fixed=("kphi",)) == [complete]
    assert concluded("undecided", ["one load"]) == ["the cause of the gap: one load", complete]


@pytest.mark.parametrize(
    "status, words",
    [
        ("named", ["no cause outside the catalogue"]),
        ("form-open", ["no cause outside the catalogue", "the law of the effect"]),
        ("partly-named", ["no cause outside the catalogue", "cause of the remaining discrepancy"]),
        ("class", ["which of the effects is present"]),
        ("unknown", ["any cause: model.toml contains the refitted soil and no new effect"]),
        ("suspected", ["any cause: model.toml predicts by a mixture"]),
        ("not-testable", []),
    ],
)
def test_what_each_status_does_not_support(status, words):
    found = concluded(status, fixed=("n", "kphi"))
    assert len(found) == len(words) + 2
    for text, word in zip(found, words, strict=False):
        assert word in text
    assert found[-2].startswith("that n, kphi in the model file are correct")
    assert found[-1] == SMALLER


@pytest.mark.parametrize(
    "before, after, hardly",
    [(1.6, 0.81, True), (1.6, 0.79, False), (1.4, 1.4, False), (9.0, 4.4, False), (9.0, 4.6, True)],
)
def test_extrapolation_is_not_supported_where_the_gap_is_hardly_reduced(before, after, hardly):
    region = GapReduction(before, after, {}, 24, "load_N >= 140")
    found = concluded("named", gap=FIGURES | {"held_out_region": region})
    assert remarked(found, "on load_N >= 140 the gap is hardly reduced") == hardly


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
    run = NextRun("heavier", "210 N", 3.2, (), (("a",), ("b", "c")))
    report = GapReport(
        "suspected", "", case_of(), **(PARTS | {"notes": notes, "next_runs": (run,)})
    )
    found = report_lines(report)
    assert len(found) == MOST_LINES and found[-1].code == "next"
    assert "tried" not in {line.code for line in found}
    assert found[-1].text == ("Next: heavier (210 N), which separates a from b + c by 3.2 sigma.")


@pytest.mark.parametrize(
    "compared, sigma, said",
    [
        ("ab", 12.0, "which separates a from b by 10 or more sigma."),
        ("abc", 3.0, "which separates a from b and 1 other by 3.0 sigma on average."),
        ("abcd", 3.0, "which separates a from b and 2 others by 3.0 sigma on average."),
    ],
)
def test_the_next_run_says_what_it_separates(compared, sigma, said):
    run = NextRun("heavier", "210 N", sigma, (), tuple((name,) for name in compared))
    assert next_run_in_words(run) == f"Next: heavier (210 N), {said}"
    long = replace(run, text="very " * 20 + "heavy")
    assert next_run_in_words(long).endswith(f"heavy). This {said[6:]}")
