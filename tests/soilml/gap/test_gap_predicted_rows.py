"""An effect counts if it predicts rows kept back; priors that are pressed against are opened."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem
from scipy.stats import norm, t

from soilml.gap import gap, workflow
from soilml.gap.evidence.held_out import HeldOutPrediction
from soilml.gap.evidence.outliers import ends_of_monotone_series
from soilml.gap.evidence.score_test import score_test
from soilml.gap.report.results import GapReduction, Suspect
from soilml.gap.search import prediction
from soilml.gap.search.posterior import Posterior
from soilml.gap.search.prediction import PredictiveGain, predictive_gains
from soilml.gap.verdict.entries import prediction_notes
from soilml.gap.verdict.reductions import grown_channels, without_grown
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.effects import EFFECTS
from soilml.remarks import texts

DIGGING = EFFECTS["slip-sinkage"]


def test_a_set_that_is_not_listed_is_no_suspect():
    logs = {(): -4.0, ("a",): -0.1, ("b",): -2.5}
    assert Posterior(logs).ranked()[0][0] == ("a",)
    found = Posterior(logs, refused={("a",): frozenset()}, unlisted=frozenset({("a",)}))
    assert [names for names, _ in found.ranked()] == [("b",)]
    assert found.probability("a") == 0.0
    both = logs | {("a", "b"): -0.2}
    part = Posterior(both, {("a", "b"): frozenset("b")}, frozenset({("a", "b")}))
    assert dict(part.ranked())[("b",)] > dict(Posterior(logs).ranked())[("b",)]


def test_a_set_of_an_implausible_size_follows_the_first_of_a_usual_size():
    logs = {(): -4.0, ("a",): -0.1, ("b",): -2.5, ("c",): -3.0}
    found = Posterior(logs, refused={("a",): frozenset()}, oversized=frozenset({("a",)}))
    assert found.probability("a") == pytest.approx(0.3 * Posterior(logs).probability("a"))
    every = {("a",), ("b",), ("c",)}

    def order(sets, penalty=0.0):
        fitted = dict.fromkeys(sets, penalty)
        return [names[0] for names, _ in found.from_first(found.ranked(), fitted)]

    assert [names[0] for names, _ in found.ranked()] == ["a", "b", "c"]
    assert order(every) == ["b", "a", "c"]
    assert order({("a",), ("c",)}) == ["c", "a"]  # what was not fitted does not come first
    assert order({("a",)}) == ["a", "b", "c"]  # nothing of a usual size was fitted
    assert order(every, penalty=-4.0) == ["a", "b", "c"]  # the rows do not raise the odds of b, c
    assert found.from_first([], {}) == []


def test_what_is_hopeless_does_not_come_before_an_implausible_size():
    def first(**logs):
        weights = {(): -9.0} | {(name,): value for name, value in logs.items()}
        found = Posterior(weights, {("a",): frozenset()}, oversized=frozenset({("a",)}))
        ranked = found.ranked()
        assert [names for names, _ in ranked] == [("a",), ("b",)]
        return found.from_first(ranked, dict.fromkeys([("a",), ("b",)], 20.0))[0][0]

    assert first(a=-0.1, b=-5.0) == ("b",)  # 0.006
    assert first(a=-0.1, b=-5.5) == ("a",)  # 0.004
    assert first(a=-4.5, b=-5.9) == ("b",)  # neither has a stated probability


def scored(*by_fold):
    return HeldOutPrediction(np.zeros(4), np.ones(4), by_fold)


def test_a_gain_has_the_standard_error_of_a_sum_over_folds():
    found = predictive_gains(
        {
            (): {"held_out_runs": scored(-1.0, -2.0, -3.0), "held_out_region": scored(-4.0)},
            ("a",): {"held_out_runs": scored(0.0, -4.0, 0.0), "held_out_region": scored(-3.0)},
        }
    )
    own = found[("a",)]
    assert own.value == pytest.approx((2.0 + 1.0) / 2.0)
    assert own.std_error == pytest.approx(np.sqrt(3.0 * np.var([1.0, -2.0, 3.0], ddof=1)) / 2.0)


def test_a_gain_below_zero_within_its_error_is_neither_better_nor_worse():
    assert PredictiveGain(0.5, 3.0).is_better
    within = PredictiveGain(-2.0, 3.0)
    assert not within.is_better
    assert not within.is_worse
    assert PredictiveGain(-3.5, 3.0).is_worse


@pytest.mark.parametrize("error", [0.0, 0.2, None])
def test_a_difference_below_one_is_no_evidence_that_an_effect_predicts_worse(error):
    assert not PredictiveGain(-0.9, error).is_worse
    assert PredictiveGain(-1.1, error).is_worse
    assert not PredictiveGain(0.0, error).is_better


def test_one_fold_tells_no_standard_error_and_none_is_stated():
    single = {(): {"held_out_region": scored(-4.0)}, ("a",): {"held_out_region": scored(-3.0)}}
    own = predictive_gains(single)[("a",)]
    assert own == PredictiveGain(1.0, None) and own.is_better
    assert Suspect(("a",), 0.0, 0.5, own.value, own.std_error).prediction == "+1.0"
    assert Suspect(("a",), 0.0, 0.5, 1.0, 0.25).prediction == "+1.0 +- 0.2"
    assert "ln density +1.0)" in predicted(1.0, None)


def predicted(value, error):
    """The note on a suspect whose gain this is."""
    with pytest.MonkeyPatch.context() as patch:
        gains = {("a",): PredictiveGain(value, error)}
        patch.setattr("soilml.gap.verdict.entries.predictive_gains", lambda _: gains)
        (note,) = prediction_notes(("a",), SimpleNamespace(predictions={}), ())
    return note.text


@pytest.mark.parametrize(
    "value, error, how",
    [
        (0.04, 0.9, "no worse"),
        (2.0, 2.5, "no worse"),
        (0.9, None, "no worse"),
        (3.0, 2.5, "better"),
        (1.1, None, "better"),
    ],
)
def test_a_suspect_predicts_better_only_beyond_the_error_of_its_gain(value, error, how):
    assert f"predicts rows kept back {how} than the soil alone does" in predicted(value, error)


@pytest.mark.slow
def test_what_may_be_stated_is_scored_though_larger_sets_are_likelier(monkeypatch):
    def explained(*names):
        return SimpleNamespace(names=names, fit=None, amplitude=None)

    larger = [explained("dig", f"other{i}") for i in range(9)]
    single, alone = explained("dig"), explained()
    own = HeldOutPrediction(np.zeros(1), np.zeros(1))
    monkeypatch.setattr(prediction, "held_out_folds", lambda *_: {"part": None})
    monkeypatch.setattr(prediction, "predict_parts", lambda _, m, __: [{"part": own}] * len(m))
    problem = SimpleNamespace(readings=None)
    result = SimpleNamespace(
        soil_alone=alone, accepted=(single,), candidates=(*larger, alone, single)
    )
    scored = list(prediction.predict_with(problem, result, 0))
    assert scored[:3] == [(), ("dig",), ("dig", "other0")]
    assert len(scored) == 1 + prediction.SCORED * prediction.ROUNDS


def test_what_predicts_no_better_within_sampling_error_is_suspected_and_not_named(monkeypatch):
    case = case_of()
    table = driven(case, [DIGGING(n1=0.4)], seed=2)
    assert gap(case, table).status == "named"
    doubtful = {("slip-sinkage",): PredictiveGain(-1.0, 3.0)}
    monkeypatch.setattr(workflow, "predictive_gains", lambda _: doubtful)
    report = gap(case, table)
    assert report.status == "suspected"
    assert report.suspects[0].effects == ("slip-sinkage",)
    assert [r.code for r in report.reasons] == ["not-predictive"]


def test_a_figure_that_grew_is_a_remark_and_no_reduction():
    figures = {
        "train": GapReduction(9.0, 1.0, {}, 30, "all rows fitted"),
        "held_out_runs": GapReduction(2.0, 3.0, {}, 30, "every run"),
    }
    kept, remarks = without_grown(figures, "slip-sinkage")
    assert list(kept) == ["train"]
    assert [(r.code, r.about) for r in remarks] == [("not-reduced", ("held_out_runs",))]
    equal = {name: replace(g, before=8.061, after=8.059) for name, g in figures.items()}
    kept, remarks = without_grown(equal, "clogging")
    assert list(kept) == ["train"] and not kept["train"].shrinks
    assert texts(remarks) == [
        "every run: the mean squared residual is 8.06 with and without clogging"
    ]
    assert without_grown(equal, "") == (equal, [])
    assert replace(equal["train"], after=8.05).shrinks


def test_a_channel_that_grows_is_a_note():
    def codes(**channels):
        figures = {"train": GapReduction(9.0, 5.0, channels, 30, "all rows fitted")}
        return [(r.code, r.about, r.text) for r in grown_channels(figures, "grousers")]

    assert codes(torque_Nm=(9.0, 2.0), sinkage_m=(2.3, 2.4)) == codes(sinkage_m=(0.5, 0.9)) == []
    ((code, about, text),) = codes(torque_Nm=(9.0, 2.0), sinkage_m=(2.3, 12.0))
    assert (code, about) == ("channel-grows", ("sinkage_m",))
    assert text.endswith("a channel grows. Sinkage: from 2.3 to 12 (all rows fitted)")


@pytest.mark.slow
def test_no_figure_of_a_report_grows_and_suspects_say_how_they_predict():
    case = case_of()
    report = gap(case, driven(case, [DIGGING(n1=0.4)], seed=2))
    assert report.effects[0].name == "slip-sinkage"
    for figures in (report.gap, report.gap_beside_remainder):
        assert figures and all(g.after <= g.before for g in figures.values())
    assert report.suspects[0].effects == ("slip-sinkage",)
    assert report.suspects[0].predictive_gain > 10.0


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_prior_that_excludes_the_soil_makes_a_suspect_and_no_name(factor):
    """Nothing is hidden; within the priors, an effect has to explain what the soil cannot."""
    case = case_of()
    wrong = Prior(0.9 * factor * case.soil.shear_modulus, 1.1 * factor * case.soil.shear_modulus)
    narrow = replace(case, prior=case.prior | {"shear_modulus": wrong})
    report = gap(narrow, driven(case, seed=3))
    assert report.status == "suspected" and report.effects == ()
    assert "soil-outside-priors" in {reason.code for reason in report.reasons}
    assert gap(case, driven(case, seed=3)).status == "no-gap"


def test_a_prior_that_excludes_the_truth_is_opened_and_the_report_says_so():
    case = case_of()
    soil = replace(case.soil, shear_modulus=0.003)
    table = driven(replace(case, soil=soil), [DIGGING(n1=0.6)], loads=(60.0,), slips=7, seed=1)
    tight = replace(case, prior=case.prior | {"shear_modulus": Prior(0.012, 0.018)})
    report = gap(tight, table)
    assert report.status == "suspected"
    assert report.suspects[0].effects == ("slip-sinkage",)
    opened = next(r for r in report.reasons if r.code == "prior-opened")
    assert "shear_modulus" in opened.about
    assert report.model.prior["shear_modulus"].lower < 0.003
    assert report.gap["train"].before > 3.0 * report.gap["train"].after


def test_the_end_of_a_monotone_series_is_known():
    case = case_of()
    table = driven(case, noise=0.0, loads=(60.0,), slips=6)
    readings = fit_problem(case, table).readings
    found = ends_of_monotone_series(readings)
    last = readings.slip == readings.slip.max()
    assert not found[~last].any()
    depth = np.where(table["slip"] == table["slip"].max(), 3.0, 1.0) * table["sinkage_m"]
    deep = fit_problem(case, Table(table.columns | {"sinkage_m": depth})).readings
    sinkage = deep.channel == deep.channels.index("sinkage")
    assert ends_of_monotone_series(deep)[sinkage & last].all()


@pytest.mark.slow
def test_a_deep_last_sinkage_is_evidence_and_no_outlier():
    case = case_of()
    table = driven(case, [DIGGING(n1=1.2)], loads=(60.0,), slips=6, seed=3)
    report = gap(case, table)
    assert not [n for n in report.notes if n.code == "outliers"]
    assert report.status != "bad-data"


def test_scores_that_few_runs_determine_need_more():
    found = score_test(
        residual=np.asarray([4.0, 0.0, 0.0]),
        columns=np.eye(3)[:, :2] @ np.asarray([[1.0, 1.0], [0.0, 0.0]]),
        space=np.zeros((3, 0)),
        signs=np.zeros(2),
        degrees_of_freedom=1e6,
        seed=0,
        own_degrees=np.asarray([3.0, np.inf]),
    )
    few, many = found.z
    assert many == pytest.approx(4.0)
    assert few == pytest.approx(norm.isf(t.sf(4.0, 3.0)))
