"""What a report says of readings that disagree with each other or with their declared noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven, fit_problem, remark

from soilml.config.measurement_noise import Discrepancy
from soilml.gap import gap
from soilml.gap.presentation import gap_text
from soilml.gap.report.page import page
from soilml.gap.report.results import GapReduction, GapReport, Suspect
from soilml.gap.report.sentences import headline
from soilml.gap.search.posterior import Posterior
from soilml.gap.search.prediction import PredictiveGain
from soilml.gap.verdict.decision import (
    Decision,
    decide,
    predictive_suspect,
    unclaimed_effects,
)
from soilml.gap.verdict.fit_notes import size_notes
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.remarks import texts

pytestmark = pytest.mark.slow

TWICE = (40.0, 40.0, 60.0, 60.0, 90.0, 90.0)


def times(text: str, factor: float) -> str:
    """The model file with all declared noise multiplied."""
    return text.replace('"1 % + 0.2"', f'"{factor} % + {0.2 * factor}"').replace(
        '"1 %"', f'"{factor} %"'
    )


def changed(table, name, values):
    """The table with other readings of one channel."""
    return Table(table.columns | {name: values})


def test_noise_far_above_the_scatter_of_repeats_is_noted():
    table = driven(case_of(), loads=TWICE)
    report = gap(case_of(times(MODEL, 5.0)), table)
    assert report.status == "no-gap"
    assert any("the noise is overstated" in note for note in texts(report.notes))
    assert not any("overstated" in note for note in texts(gap(case_of(), table).notes))


def test_two_runs_that_differ_are_named_beside_the_suspects():
    table = driven(case_of(), loads=(60.0, 60.0), slips=12)
    torque = table["torque_Nm"] * np.where(table["run"] == "run_1", 1.43, 1.0)
    report = gap(case_of(), changed(table, "torque_Nm", torque))
    assert report.status == "suspected"
    listed = [reason for reason in texts(report.reasons) if "replicate rows disagree" in reason]
    assert len(listed) == 1 and "torque" in listed[0] and listed[0] in gap_text(report)


def test_understated_noise_is_undecided():
    report = gap(case_of(times(MODEL, 0.33)), driven(case_of(), seed=4))
    assert report.status == "undecided"
    assert any("as much as their declared noise" in reason for reason in texts(report.reasons))


def test_a_false_alarm_that_nothing_explains_is_undecided(monkeypatch):
    monkeypatch.setattr("soilml.gap.search.stepwise.GAP_LEVEL", 1.01)
    report = gap(case_of(), driven(case_of()))
    assert report.status == "undecided"
    assert "no effect or smooth discrepancy is better" in report.sentence
    assert not report.suspects and not report.next_runs and not report.discrepancy
    for name, before in report.soil_before.items():
        assert report.soil_after[name].value == before.value


def test_a_strange_but_repeatable_response_leaves_the_soil_where_it_was():
    table = driven(case_of(), loads=TWICE, seed=2)
    bump = np.exp(-0.5 * ((table["slip"] - 0.4) / 0.06) ** 2)
    table = changed(table, "torque_Nm", table["torque_Nm"] * (1.0 + 0.35 * bump))
    report = gap(case_of(), changed(table, "drawbar_pull_N", table["drawbar_pull_N"] + 8.0 * bump))
    assert report.status == "unknown"
    for name, before in report.soil_before.items():
        assert report.soil_after[name].value == pytest.approx(before.value, rel=1e-6)
    ranges = {name: np.ptp([0.0, *table[name]]) for name in report.discrepancy}
    for name, left in report.discrepancy.items():
        assert left.after_value < 0.3 * ranges[name]
    assert "no named effect does not" not in page(report, "model.toml", "runs.csv")


CHANNELS = ("torque_Nm", "drawbar_pull_N", "sinkage_m")


def waved(table, share=0.015):
    """The table with a smooth wave of this share of the largest reading in each channel."""
    columns = dict(table.columns)
    for i, name in enumerate(CHANNELS):
        phase = 7.0 * table["slip"] + 0.008 * table["load_N"] + i
        columns[name] = columns[name] + share * np.abs(columns[name]).max() * np.sin(phase)
    return Table(columns)


def test_what_is_within_the_declared_discrepancy_is_no_gap():
    case, table = case_of(), waved(driven(case_of(), seed=4))
    assert gap(case, table).status not in ("no-gap", "undecided")
    declared = {name: Discrepancy(share=0.02) for name in CHANNELS}
    report = gap(replace(case, discrepancy=declared), table)
    assert report.status == "no-gap"
    assert "noise and declared discrepancy" in report.sentence
    assert report.model.discrepancy == declared
    assert (
        report.soil_after["cohesion"].std > 1.5 * gap(case, driven(case)).soil_after["cohesion"].std
    )


def test_an_effect_is_named_beside_a_declared_discrepancy_and_is_not_found_again():
    case = case_of()
    table, later = (
        waved(driven(case, [EFFECTS["slip-sinkage"](n1=0.4)], seed=seed)) for seed in (4, 5)
    )
    first = gap(case, table)
    assert first.status == "partly-named" and first.cause_set == (("slip-sinkage",),)
    again = gap(first.model, later)
    assert again.status in ("no-gap", "undecided") and not again.cause_set


def test_a_cause_by_a_law_far_from_the_catalogue_is_suspected():
    case = case_of()
    other = EFFECTS["slip-sinkage"](n1=0.2, by_slip=7.0)
    report = gap(case, driven(case, [other], slips=12))
    assert report.status == "suspected"
    assert report.suspects[0].effects == ("slip-sinkage",)
    assert "other-law" in {reason.code for reason in report.reasons}
    assert report.model.suspected == ("slip-sinkage",)
    assert [e.name for e in report.model.model.effects] == ["slip-sinkage"]
    assert "suspect-predicts" in {note.code for note in report.notes}
    assert report.gap["train"].after < 0.1 * report.gap["train"].before


def test_figures_are_those_of_the_suspect_that_is_listed_first():
    """Here the largest evidence is that of two effects, and a rival with its additions leads."""
    weights = {(): -5.0, ("b", "c"): -1.0, ("a",): -1.1, ("a", "d"): -1.3}
    sets = [
        SimpleNamespace(names=names, objective=-4.0 * weight, amplitude=np.ones(1), penalty=0.0)
        for names, weight in weights.items()
    ]
    ordered = sorted(sets, key=lambda one: one.objective)
    result = SimpleNamespace(
        has_gap=True,
        candidates=ordered,
        likeliest=ordered[0],
        likeliest_suspect=ordered[0],
        soil_alone=sets[0],
        posterior=Posterior(weights),
        accepted=ordered[:1],
    )
    assert result.likeliest.names == ("b", "c")
    decision = decide(None, result, [remark("one load only")], [])
    assert decision.status == "suspected" and decision.shown.names == ("a",)
    report = GapReport(
        "suspected",
        "",
        case_of(),
        suspects=(Suspect(("a",), 0.0, 0.45),),
        best_unclaimed=unclaimed_effects(decision, result),
        gap={"train": GapReduction(8.8, 1.0, {}, 108, "all rows fitted")},
    )
    assert "first suspect is a (probability 0.45); the gap shrinks 8.80 -> 1.0" in headline(report)


@pytest.mark.parametrize(("height", "said"), [(0.08, True), (0.02, False)])
def test_lugs_that_would_have_to_be_far_larger_than_lugs_are_remarked_on(height, said):
    case = case_of()
    problem = fit_problem(case, driven(case, [EFFECTS["grousers"](height=height)], noise=0.0))
    coordinates = [*problem.soil, *problem.size_coordinates(["grousers"])]
    fit = problem.fit(problem.with_effects(["grousers"]), coordinates, {})
    notes = size_notes(fit.coordinates, fit.x.tolist())
    expected = "height of grousers would have to be 80.0 mm, 8 times its usual size (10.0 mm)"
    assert [n.text.replace("\N{NO-BREAK SPACE}", " ") for n in notes] == [expected] * said


def test_beside_a_large_remainder_a_cause_of_little_evidence_is_suspected():
    """Four times the usual error of a model is left: the catalogue lacks something."""

    def candidate(names, objective, amplitude):
        fit = SimpleNamespace(x=np.zeros(0), precision=np.zeros(0), coordinates=())
        return SimpleNamespace(
            names=names,
            objective=objective,
            amplitude=np.asarray([0.0, amplitude]),
            fit=fit,
            shape_deviation=0.0,
            shape_supported=False,
            penalty=0.0,
        )

    problem = SimpleNamespace(readings=SimpleNamespace(channels=("torque", "drawbar_pull")))

    def status(gain, amplitude):
        best, none = candidate(("a",), -gain, amplitude), candidate((), 0.0, 25.0)
        found = Posterior({("a",): -0.01, (): -5.0})
        result = SimpleNamespace(
            has_gap=True,
            adequate=False,
            soil_alone=none,
            likeliest=best,
            likeliest_suspect=best,
            accepted=(best,),
            candidates=(best, none),
            posterior=found,
        )
        decision = decide(problem, result, (), ())
        return decision.status, decision.reason and decision.reason.about

    assert status(20.0, 4.0) == ("suspected", ("a", "drawbar_pull_N"))
    assert status(40.0, 2.5) == ("suspected", ("a", "drawbar_pull_N"))
    assert status(40.0, 1.6) == ("partly-named", None)
    assert status(60.0, 4.0) == ("partly-named", None)


def test_a_suspect_predicts_where_rows_kept_back_are_likelier_with_it():
    def chosen(gain, status="suspected", scored=("a",)):
        gains = {} if gain is None else {scored: PredictiveGain(gain, 1.0)}
        shown = SimpleNamespace(names=("a",))
        return predictive_suspect(Decision(status, (), shown), gains)

    assert chosen(2.0) == ("a",)
    assert chosen(-2.0) == chosen(0.0) == chosen(None) == ()
    assert chosen(2.0, scored=("c",)) == ()  # another suspect than the one that is shown
    assert chosen(2.0, status="named") == ()
    assert predictive_suspect(Decision("suspected", (), None), {}) == ()
    several = tuple(SimpleNamespace(names=(name,)) for name in "ab")
    assert predictive_suspect(Decision("class", several, several[0]), {}) == ("a",)
