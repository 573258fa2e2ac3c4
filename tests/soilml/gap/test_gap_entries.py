"""Entries of a report from analyses that are made up: notes, suspects, what is shown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, remark

from soilml.fitting.coordinates import Coordinate
from soilml.gap.checks import ONE_LOAD
from soilml.gap.evidence.linearised_fit import AMPLITUDES
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.report.page import conditions_text
from soilml.gap.report.results import EstimatedValue, soil_test_agreement
from soilml.gap.search.explanation import (
    Explanation,
)
from soilml.gap.search.posterior import Posterior
from soilml.gap.verdict import entries
from soilml.gap.verdict.entries import (
    analysis_notes,
    competing_explanations,
    conditions_of_suspects,
    soil_beside_discrepancy,
    soil_marginal,
    suspects,
    variance_component_entries,
)
from soilml.gap.verdict.fit_notes import beyond_priors_notes, bound_notes
from soilml.numerics.prior import Prior
from soilml.physics.soils.soil_tests import ShearStrength
from soilml.remarks import Remark, texts


def made(*names, objective=0.0, amplitude=(0.0, 0.0)):
    """A candidate with this objective and discrepancy."""
    known = np.asarray(amplitude, dtype=float)
    evidence = Evidence(objective, known, np.zeros(0), known)
    marginal = MarginalFit(SimpleNamespace(objective=objective, x=np.zeros(2)), evidence)
    return Explanation(names, marginal, marginal)


def analysed(*candidates, accepted=(), runs=("a", "b"), weights=None, outliers=(), **components):
    """An analysis with these candidates, of readings of two channels."""
    found = {
        "noise_scale": np.ones(2),
        "friction_angle_std": 0.0,
        "bearing_std": 0.0,
        "autocorrelation": 0.0,
    }
    soil = SimpleNamespace(objective=50.0, x=np.zeros(2), case=None, values=dict)
    evidence = lambda fit, start=None: ("evidence of", fit, start)  # noqa: E731
    problem = SimpleNamespace(
        readings=SimpleNamespace(channels=("torque", "sinkage"), runs=runs),
        covariance=SimpleNamespace(components=SimpleNamespace(**(found | components))),
        discrepancy=SimpleNamespace(evidence=evidence),
        penalty=lambda names: 8.0 * len(names),
    )
    result = SimpleNamespace(
        soil=soil,
        candidates=candidates,
        accepted=accepted,
        soil_alone=next((c for c in candidates if not c.names), None),
        posterior=Posterior(weights or {}),
        has_gap=False,
    )
    given = {"outliers": outliers, "predictions": {}, "within_priors": None}
    return SimpleNamespace(problem=problem, result=result, **given)


def test_the_soil_beside_a_discrepancy_stays_where_noise_put_it_under_the_largest():
    usual = made(amplitude=(AMPLITUDES[-2], 0.15))
    assert soil_beside_discrepancy(analysed(usual)) is usual.best
    largest = made(amplitude=(AMPLITUDES[-1], 0.15))
    given = analysed(largest)
    found = soil_beside_discrepancy(given)
    assert found.fit is given.result.soil
    assert found.evidence[:2] == ("evidence of", given.result.soil)
    assert found.evidence[2] is largest.amplitude
    nothing = analysed()
    assert soil_beside_discrepancy(nothing).evidence == ("evidence of", nothing.result.soil, None)
    without = analysed(made())
    found = soil_beside_discrepancy(without)
    assert found.fit is without.result.soil and found.evidence.value == 50.0
    assert not found.evidence.amplitude.any() and found.evidence.expected_amplitude.size == 2
    assert soil_marginal(without).evidence.step.size == 2


def test_explanations_to_distinguish_are_those_not_rejected_or_the_best_and_its_runner_up():
    none, a, b, c, d = made(), made("a"), made("b"), made("c"), made("d")
    pair = made("a", "e")
    weights = {("b",): 0.6, ("a",): 0.3, ("d",): 0.1, (): 1e-6}

    def compared(*candidates, claimed=(), own=None):
        logs = {names: float(np.log(weight)) for names, weight in (own or weights).items()}
        return competing_explanations(analysed(*candidates, weights=logs), claimed)

    assert compared(none, a, b, d, claimed=(b, a)) == [b, a]  # a class
    assert compared(none, a, b, d) == [b, a, d]  # suspects
    assert compared(none, a, d) == [a, d]  # of what is not fitted, nothing is predicted
    # a set that contains the named one is no rival of it
    named = {("a",): 0.99, ("b",): 0.01, (): 1e-6}
    assert compared(pair, a, none, b, c, claimed=(a,), own=named) == [a, b]
    # what has no stated probability is no rival beside one that has
    unlikely = {("a",): 0.7, ("b",): 0.3, ("c",): 0.004, (): 1e-6}
    assert compared(a, b, c, none, own=unlikely) == [a, b]
    alone = {("a",): 1.0, ("c",): 0.004, (): 1e-6}
    assert compared(a, b, c, none, own=alone) == [a, c]
    assert competing_explanations(analysed(none), ()) == []


def test_suspects_are_the_likeliest_eight_under_stated_conditions():
    weights = {(f"e{i}",): -1.0 - i for i in range(12)} | {(): -3.0}
    found = suspects(analysed(weights=weights), ())
    # prior odds of 1 to e^4: those below 1 to e^4 beside the soil alone are none, but the first
    assert [s.effects[0] for s in found] == [f"e{i}" for i in range(6)]
    many = suspects(analysed(weights={names: 0.1 * w for names, w in weights.items()}), ())
    assert [s.effects[0] for s in many] == [f"e{i}" for i in range(8)]
    unlikely = {("e0",): -9.0, (): -3.0}
    assert [s.effects for s in suspects(analysed(weights=unlikely), ())] == [("e0",)]
    assert found[0].log_odds > found[1].log_odds
    plain = conditions_of_suspects(analysed(), [])
    assert [c.code for c in plain] == ["catalogue-complete"]
    one = conditions_of_suspects(analysed(runs=("a",)), [Remark(ONE_LOAD, "")])
    assert conditions_text(one).startswith("if no other cause than those of the catalogue has a ")
    assert ", and if the bed was the same for all rows, and if the soil" in conditions_text(one)


def test_what_is_hopeless_is_no_suspect_beside_one_of_an_implausible_size():
    def listed(second):
        given = analysed(made("a"), weights={("a",): -0.1, ("b",): second, (): -9.0})
        given.result.posterior = replace(
            given.result.posterior,
            refused={("a",): frozenset()},
            oversized=frozenset({("a",)}),
        )
        given.result.candidates[0].fit.coordinates = ()
        given.result.candidates[0].fit.x = ()
        return [s.effects for s in suspects(given, ())]

    assert listed(-5.0) == [("a",), ("b",)]  # b was not fitted: it does not come first
    assert listed(-5.5) == [("a",)]


def test_a_pair_that_contains_a_named_effect_is_listed_as_that_effect():
    weights = {("a", "b"): -0.1, ("a",): -3.0, ("c",): -8.0, (): -30.0}
    given = analysed(made("a"), made("a", "b"), weights=weights)
    assert suspects(given, ())[0].effects == ("a", "b")
    found = suspects(given, [made("a")])
    assert [s.effects for s in found] == [("a",), ("c",)]
    assert found[0].log_odds > found[1].log_odds


def test_a_part_of_a_stated_pair_is_listed_only_if_it_occurs_without_the_rest():
    pairs = [made("a", "b"), made("a", "c")]
    for alone, listed in ((1e-6, False), (0.1, True)):
        weights = {("a", "b"): 0.5, ("a", "c"): 0.4, ("a",): 1e-6, ("b",): 1e-6, ("c",): alone}
        logs = {names: float(np.log(weight)) for names, weight in weights.items()}
        given = analysed(*map(made, "abc"), *pairs, weights=logs | {(): -30.0})
        found = [s.effects for s in suspects(given, pairs)]
        assert {("a", "b"), ("a", "c")} <= set(found)
        assert (("c",) in found) == listed and ("b",) not in found


def test_noise_that_is_declared_too_large_is_said_once_for_each_channel(monkeypatch):
    repeated = Remark("noise-overstated", "a", ("x",))
    torque, other = (Remark("noise-too-large", *own) for own in (("b", ("x",)), ("c", ("y",))))
    monkeypatch.setattr(entries, "overstated_noise_notes", lambda readings: [repeated])
    monkeypatch.setattr(entries, "large_noise_notes", lambda problem, soil: [torque, other])
    assert notes(analysed(runs=("a",)))[:2] == ["a", "c"]


def notes(given):
    fit = SimpleNamespace(coordinates=[], x=np.zeros(0))
    return texts(analysis_notes(given, fit, [fit], [remark("run a and run b")]))


def test_notes_on_outliers_noise_runs_and_autocorrelation(monkeypatch):
    monkeypatch.setattr(entries, "overstated_noise_notes", lambda readings: [])
    monkeypatch.setattr(entries, "large_noise_notes", lambda problem, soil: [])
    assert notes(analysed(runs=("a",))) == ["replicate rows disagree: run a and run b"]
    several = notes(
        analysed(
            outliers=tuple(f"o{i}" for i in range(7)),
            noise_scale=np.asarray([1.25, 1.26]),
            autocorrelation=0.5,
            runs=tuple("abcdef"),
        )
    )
    assert several == [
        "7 readings are outliers and were excluded: o0, o1, o2, o3, o4, o5",
        "residuals of sinkage_m about the likeliest explanation, beside smooth functions, are 1.3 "
        "times the declared noise: noise, or a law that changes fast with slip",
        "replicate rows disagree: run a and run b",
        "the noise of neighbouring samples of a run is correlated (0.5), which reduces their "
        "weight",
    ]
    (one, _, few) = notes(
        analysed(outliers=("o",), runs=tuple("abcde"), friction_angle_std=0.01, bearing_std=0.04)
    )
    assert one == "1 reading is an outlier and was excluded: o"
    assert few.startswith("run-to-run variation of the soil cannot be estimated from fewer than 6")
    for runs in ("ab", "abc"):
        assert notes(analysed(runs=tuple(runs)))[-1].startswith("run-to-run variation")
    assert "Assumed are 0.57 deg of friction angle and 4 % of bearing strength, so" in few


def test_a_gap_lies_partly_in_a_test_of_the_soil_that_disagrees(monkeypatch):
    monkeypatch.setattr(entries, "overstated_noise_notes", lambda readings: [])
    monkeypatch.setattr(entries, "large_noise_notes", lambda problem, soil: [])
    monkeypatch.setattr(
        entries, "disagreeing_soil_tests", lambda case, values: ["plate 3 sigma off"]
    )
    given = analysed(runs=("a",))
    assert not any("plate" in note for note in notes(given))
    given.result.has_gap = True
    assert any("plate 3 sigma off; part of the gap" in note for note in notes(given))


def test_a_soil_outside_the_given_priors():
    soil = {
        "inside": Coordinate("cohesion", "Pa", Prior(0.0, 9000.0)),
        "beyond": Coordinate("friction_angle", "rad", Prior(0.2, 0.9)),
        "fixed": Coordinate("n", "1", Prior(0.5, 1.5), nominal=1.0),
        "effect": Coordinate("slip-sinkage.n1", "1", Prior(0.0, 1.0)),
    }
    values = dict(zip((c.path for c in soil.values()), (900.0, 0.3, 1.2, 0.4), strict=True))
    fit = SimpleNamespace(coordinates=list(soil.values()), values=lambda: values)
    given = {"cohesion": Prior(0.0, 1000.0), "friction_angle": Prior(0.5, 0.7)}
    (note,) = beyond_priors_notes(given, fit)
    assert note.about == ("friction_angle", "n")
    assert note.text.endswith("friction angle 17.2° (prior 28.6° to 40.1°), n 1.20 (given as 1.00)")
    values |= {"friction_angle": 0.5}
    assert [note.about for note in beyond_priors_notes(given, fit)] == [("n",)]
    assert beyond_priors_notes(given | {"n": Prior(1.0, 1.2)}, fit) == []


def test_estimates_at_a_bound():
    soil = Coordinate("cohesion", "Pa", Prior(0.0, 1000.0))
    size = Coordinate("slip-sinkage.n1", "1", Prior(0.0, 1.0), upper=4.0)
    end = "is at a bound of its prior: soilml identify has its interval"
    one = f"{soil.path} in model.toml (the soil alone) {end}"
    assert texts(bound_notes([soil, soil, soil], [0.0009, 0.5, 0.5])) == [one]
    (both,) = bound_notes([soil, soil, soil], [0.0009, 0.9991, 0.5])
    assert both.about == (soil.path,) * 2
    assert both.text == (
        f"{soil.path}, {soil.path} in model.toml (the soil alone) are at a bound of their priors: "
        "soilml identify has their intervals"
    )
    assert bound_notes([soil, soil], [0.0011, 0.9989]) == []
    assert texts(bound_notes([size, size], [3.9961, 0.0])) == [
        f"{size.path} in model.toml (slip-sinkage) is at its upper bound"
    ]
    assert texts(bound_notes([size, soil], [0.5, 0.0])) == [
        f"{soil.path} in model.toml (slip-sinkage) {end}"
    ]
    assert bound_notes([size], [3.9959]) == []


def test_variance_components_by_the_names_of_columns():
    given = analysed(
        noise_scale=np.asarray([1.0, 1.5]),
        friction_angle_std=0.01,
        bearing_std=0.02,
        autocorrelation=0.3,
    )
    assert variance_component_entries(given) == {
        "noise_scale_torque_Nm": 1.0,
        "noise_scale_sinkage_m": 1.5,
        "friction_angle_std": 0.01,
        "bearing_std": 0.02,
        "autocorrelation": 0.3,
    }


def test_a_test_of_the_soil_is_compared_with_the_soil_before_and_after():
    """Strength of cohesion plus normal stress times the tangent of the friction angle."""
    test = ShearStrength(normal_stress=8e3, strength=5e3, scatter=0.2)
    case = replace(case_of(), soil_tests=(test,))

    def soil(cohesion, angle):
        values = {"cohesion": cohesion, "friction_angle": angle}
        return {name: EstimatedValue(value, 0.0, "") for name, value in values.items()}

    (found,) = soil_test_agreement(case, soil(500.0, 0.5), soil(900.0, 0.6))
    before, after = 500.0 + 8e3 * np.tan(0.5), 900.0 + 8e3 * np.tan(0.6)
    assert (found.before, found.after) == (pytest.approx(before), pytest.approx(after))
    assert found.sigma_before == pytest.approx(np.log(before / 5e3) / 0.2)
    assert found.sigma_after == pytest.approx(np.log(after / 5e3) / 0.2)
    assert (found.measured, found.unit, found.label) == (5e3, "Pa", test.label())
