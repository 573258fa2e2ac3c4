"""Selection: an effect whose law is not the catalogue's is fitted in full, and named."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.fitting.effect_signatures import effect_signatures
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.search import passes, stepwise
from soilml.gap.search.screening import (
    MIN_FITTED,
    effects_to_fit,
    free_law_gains,
    noise_only_gains,
    predicted_with_and_without,
)
from soilml.gap.search.stepwise import _fit_soil_alone, search
from soilml.physics.effects import EFFECTS

#: The stresses move to the front of the contact in proportion to slip.
MOVING = EFFECTS["stress-shift"](shift=0.3, slip_power=1.0)


@pytest.fixture(scope="module")
def moved():
    """A problem on rows with that effect, and the soil alone fitted to them."""
    case = case_of()
    problem = fit_problem(case, driven(case, [MOVING], seed=3))
    return problem, problem.fit_soil([np.full(3, 0.5)])


def alone(soil):
    """The soil alone without discrepancy."""
    none = np.zeros(3)
    return MarginalFit(soil, Evidence(soil.objective, none, np.zeros(len(soil.x)), none))


@pytest.fixture(scope="module")
def screened(moved):
    problem, soil = moved
    signatures, _ = effect_signatures(soil.fitted(), problem.readings, problem.effects)
    none = _fit_soil_alone(problem, soil, {})
    return none, signatures, predicted_with_and_without(problem, none, soil, signatures)


def test_an_effect_with_its_own_law_is_selected_though_the_catalogues_law_gains_little(
    moved, screened
):
    problem, soil = moved
    none, signatures, gains = screened
    by_gain = sorted(gains, key=lambda name: -gains[name])[:MIN_FITTED]
    assert "stress-shift" not in by_gain
    assert "stress-shift" in effects_to_fit(problem, none, soil, signatures, gains, {})


def test_a_free_law_explains_at_least_what_the_catalogues_does(moved, screened):
    problem, soil = moved
    _, signatures, _ = screened
    free = free_law_gains(problem, np.zeros(3), soil, signatures)
    plain = noise_only_gains(problem, soil, signatures)
    positive = [name for name in free if free[name] > 0.0]
    assert len(positive) > 5
    assert all(free[name] >= plain[name] - 1e-6 for name in positive)
    assert max(free.values()) <= soil.residual @ soil.residual


@pytest.mark.slow
def test_an_effect_within_reach_of_an_earlier_search_is_fitted_again(moved, screened):
    problem, soil = moved
    none, signatures, _ = screened
    found = search(problem, soil, seed=0)
    assert found.candidates[0].names == ("stress-shift",)
    gains = {"slip-sinkage": 9.0, "rate": 8.0, "slope": 7.0, "bulldozing": 6.0, "grousers": 5.0}
    gains["stress-shift"] = -100.0
    own = [s for s in signatures if s.name == "slip-sinkage"]
    starts = {c.names: c for c in found.candidates}
    assert "stress-shift" not in effects_to_fit(problem, none, soil, own, gains, {})
    assert "stress-shift" in effects_to_fit(problem, none, soil, own, gains, starts)


def test_a_look_goes_on_from_all_that_is_known(monkeypatch):
    made = SimpleNamespace
    earlier, first = made(names=("a",), objective=9.0), made(names=("b",), objective=1.0)
    replaced = made(names=("a",), objective=5.0)
    look = replace(passes.no_result("soil"), candidates=(first, replaced))
    begun = passes.Analysis("problem", look), {("a",): earlier}
    monkeypatch.setattr(passes, "look_further", lambda *given: given)
    found, starts = passes.with_singles(begun, 7)
    assert starts == {("a",): earlier}  # objectives of another covariance are not among them
    assert found.result == ("problem", look, 7, starts) and found.problem == "problem"


def test_the_soil_alone_is_not_fitted_again_from_a_soil_that_has_stayed(monkeypatch):
    def explained(name, cohesion, size):
        coordinates = SimpleNamespace(path="c", effect=""), SimpleNamespace(path=name, effect=name)
        fit = SimpleNamespace(coordinates=coordinates, x=np.asarray([cohesion, size]))
        fit.start_values = lambda: {"c": cohesion, name: size}
        return SimpleNamespace(names=(name,), fit=fit, amplitude=None, objective=0.0)

    asked = []
    monkeypatch.setattr(stepwise, "fit_marginal", lambda _, fits, low: asked.extend(fits) or [])
    problem = SimpleNamespace(case=None, soil=())
    best = SimpleNamespace(evidence=SimpleNamespace(value=9.0))
    alone = SimpleNamespace(best=best, objective=9.0)
    starts = {("a",): explained("a", 0.5, 0.1), ("b",): explained("b", 0.5, 0.1)}
    level = [explained("a", 0.54, 0.9), explained("b", 0.56, 0.1)]
    assert stepwise._from_soils_of(problem, alone, level, starts) is alone
    assert [fit.start["c"] for fit, _ in asked] == [0.56]  # the soil of `a` has stayed
    asked.clear()
    stepwise._from_soils_of(problem, alone, level, {})
    assert len(asked) == 2


def test_a_look_goes_on_with_the_sets_and_single_effects_that_it_lacks(monkeypatch):
    def made(*names):
        return SimpleNamespace(names=names)

    def likely(*_, few):
        asked.append("the first" if few else "all likely")
        return {"a": True, "b": False}

    def fit_level(problem, soil, alone, sets, starts, under_noise, others):
        asked.append((sorted(sets), under_noise, [c.names for c in others]))
        return [made(*names) for names in sets]

    def concluded(problem, look, fitted, seed):
        return replace(look, candidates=tuple(fitted.values()))

    for name, value in {
        "effects_to_fit": likely,
        "_fit_level": fit_level,
        "_from_soils_of": lambda problem, alone, *_: alone,
        "explained_nothing": lambda *_: {"b"},
        "_concluded": concluded,
    }.items():
        monkeypatch.setattr(stepwise, name, value)
    asked, pair = [], ("a", "b")
    look = replace(passes.no_result("soil"), candidates=(made(),), without_gain={"a", "c"})
    look = stepwise.look_further(None, look, 0, {}, [pair], singles="none")
    assert asked == [([pair], set(), [])] and look.without_gain == {"a", "b", "c"}
    asked.clear()
    look = stepwise.look_further(None, look, 0, {}, [pair], singles="first")
    assert asked == ["the first", ([("a",), ("b",)], {"a"}, [pair])]
    assert look.without_gain == {"b", "c"}
    asked.clear()
    look = stepwise.look_further(None, look, 0, {})
    assert asked == ["all likely", ([], {"a"}, [pair, ("a",), ("b",)])]
    assert [c.names for c in look.candidates] == [(), pair, ("a",), ("b",)]


@pytest.mark.parametrize("objective, reused", [(-1.0, True), (1e9, False)])
def test_a_further_search_takes_the_signatures_beside_the_last_explanation(
    moved, monkeypatch, objective, reused
):
    problem, soil = moved
    fit, signature = SimpleNamespace(objective=objective), SimpleNamespace(name="slope")
    earlier = passes.no_result(soil)
    test = replace(earlier.final_test, signatures=(signature,))
    earlier = replace(earlier, accepted=(SimpleNamespace(names=("a",)),), final_test=test)
    asked = []

    def estimated(problem, best, signatures):
        asked.append((best is fit, list(signatures)))
        return problem

    known = {("a",): SimpleNamespace(fit=fit)}
    monkeypatch.setattr(passes, "restated_candidates", lambda *_: known)
    monkeypatch.setattr(passes, "with_estimated_covariance", estimated)
    monkeypatch.setattr(passes, "first_look", lambda *_, **__: "look")
    begun, starts = passes.begin(problem, 0, str, earlier)
    assert asked == [(reused, [signature] if reused else [])]
    assert begun.result == "look" and starts == known
