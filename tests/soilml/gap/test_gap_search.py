"""Candidates and the search: what free shapes cost, and how larger sets give way."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem
from scipy.stats import multivariate_normal

from soilml.fitting.coordinates import shape_coordinates
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.predictions import linearise
from soilml.gap.evidence.held_out import held_out_folds, predict_parts
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.search.explanation import (
    CandidateRequest,
    Explanation,
    fit_candidates,
    fit_shapes,
)
from soilml.gap.search.posterior import (
    IN_CATALOGUE,
    OTHER_LAW,
    Posterior,
    explanations,
    for_decisions,
)
from soilml.gap.search.screening import predicted_gains
from soilml.gap.search.stepwise import search
from soilml.gap.verdict.decision import law_matters
from soilml.gap.verdict.reductions import gap_reduction, predict_held_out
from soilml.physics.effects import EFFECTS

DIGGING = EFFECTS["slip-sinkage"]
FEW = ("slip-sinkage", "bulldozing", "exit-angle", "torque-gain")


def small(problem):
    return replace(problem, effects={name: EFFECTS[name] for name in FEW})


@pytest.fixture(scope="module")
def dug():
    """A problem on rows in which the wheel digs itself in, and the soil alone fitted to them."""
    case = case_of()
    problem = small(fit_problem(case, driven(case, [DIGGING(n1=0.4)], seed=2)))
    return problem, problem.fit_soil([np.full(3, 0.5)])


def alone(soil):
    """The soil alone without discrepancy."""
    none = np.zeros(3)
    return MarginalFit(soil, Evidence(soil.objective, none, np.zeros(len(soil.x)), none))


def fitted(problem, soil, *names):
    """A candidate by its catalogue law, with free shapes beside it."""
    none = np.zeros(len(problem.readings.channels))
    found = fit_candidates(problem, [CandidateRequest(names, soil.start_values(), none)])
    return fit_shapes(problem, found)[0]


@pytest.fixture(scope="module")
def named(dug):
    return fitted(*dug, "slip-sinkage")


def test_a_refused_explanation_counts_as_a_cause_outside_the_catalogue():
    weights = {(): 0.1, ("slope",): 0.6, ("grousers",): 0.1, ("grousers", "slope"): 0.2}
    logs = {names: float(np.log(w)) for names, w in weights.items()}
    inside = Posterior(logs)
    refused = Posterior(logs, {("slope",): frozenset()}, frozenset({("slope",)}))
    both = ("grousers", "slope")
    partly = Posterior(logs, {both: frozenset({"grousers"})}, frozenset({both}))
    assert partly.probability("grousers") == pytest.approx(inside.probability("grousers"))
    assert partly.probability("slope") == pytest.approx(IN_CATALOGUE * 0.6)
    assert inside.probability("slope") == pytest.approx(IN_CATALOGUE * 0.8)
    assert refused.probability("slope") == pytest.approx(IN_CATALOGUE * 0.2)
    assert refused.probability("grousers") == pytest.approx(inside.probability("grousers"))
    assert refused.log_odds("slope") == pytest.approx(np.log(0.2 / 0.8))


def test_an_explanation_by_another_law_counts_in_part():
    weights = {(): 0.1, ("slope",): 0.6, ("grousers",): 0.3}
    found = Posterior({n: float(np.log(w)) for n, w in weights.items()}, {("slope",): frozenset()})
    assert found.probability("slope") == pytest.approx(IN_CATALOGUE * OTHER_LAW * 0.6)
    first = [names for names, _ in found.ranked()]
    assert first == sorted(first, key=lambda names: -found.probability(*names))


def ranked(weights, **sets):
    """Suspects with their odds, of sets of effects joined by a plus sign, with these weights."""
    total = sum(weights.values())
    logs = {tuple(n.split("+")) if n else (): np.log(w / total) for n, w in weights.items()}
    return {"+".join(names): np.exp(odds) for names, odds in Posterior(logs, **sets).ranked()}


def test_partners_that_are_less_likely_than_not_count_towards_their_suspect():
    pairs = {"a+dig": 0.3, "b+dig": 0.3, "dig": 0.2}
    found = ranked(pairs | {"a": 0.1, "": 0.1})
    assert list(found) == ["dig", "a"]
    assert found["dig"] == pytest.approx(0.8 / 0.2)
    assert found["a"] == pytest.approx(0.4 / 0.6)


def test_two_effects_that_are_both_likelier_than_not_are_one_suspect():
    found = ranked({"a+dig": 0.6, "dig": 0.3, "b+dig": 0.05, "": 0.05})
    assert list(found) == ["a+dig"]  # each is a part of it, and "b" was not fitted alone
    assert found["a+dig"] == pytest.approx(0.6 / 0.4)


def test_rivals_none_of_which_is_likelier_than_not_are_listed_each():
    found = ranked({"a+b": 0.3, "c": 0.4, "a": 0.1, "": 0.2})
    assert list(found) == ["c", "a+b"]  # where "a" is present, so is "b": 0.3 of 0.4
    assert found["c"] > found["a+b"] == pytest.approx(0.3 / 0.7)


def test_a_pair_of_implausible_size_does_not_take_the_place_of_its_part():
    weights = {"a+b": 0.3, "c": 0.4, "a": 0.1, "": 0.2}
    assert list(ranked(weights, oversized=frozenset({("a", "b")}))) == ["c", "a"]


def test_the_true_law_needs_no_shape(named):
    assert not named.shape_supported
    assert named.shape_deviation == 0.0
    assert named.fit is named.catalogue_law.fit
    assert named.objective == named.catalogue_law.evidence.value + named.penalty
    assert named.penalty > 0.0
    assert named.free_law.fit.objective <= named.catalogue_law.fit.objective + 0.1


def test_free_shapes_are_supported_where_the_law_is_another(dug):
    case = case_of()
    bent = DIGGING(n1=0.4, slip_power=1.0)
    problem = small(fit_problem(case, driven(case, [bent], seed=2)))
    found = fitted(problem, dug[1], "slip-sinkage")
    assert found.shape_supported and found.fit is found.free_law.fit
    assert found.shape_deviation == pytest.approx(1.0, abs=0.3)  # 1 is one prior spread
    assert found.fit.values()["slip-sinkage.slip_power"] == pytest.approx(1.0, abs=0.15)
    assert law_matters(problem, found)


def test_an_effect_with_a_certain_law_has_no_free_shape(dug):
    found = fitted(*dug, "torque-gain")
    assert found.free_law is None and not found.shape_supported


def test_a_law_that_predicts_the_same_does_not_matter(dug, named):
    assert not law_matters(dug[0], named)


def test_slopes_are_shaped_only_as_far_as_slip_and_load_vary():
    case = case_of()
    problem = fit_problem(case, driven(case, loads=(60.0, 60.0)))
    shapes = {c.path for c in problem.shape_coordinates(["slip-sinkage", "wheel-flexibility"])}
    assert shapes == {"slip-sinkage.slip_power", "slip-sinkage.by_slip"}
    (load,) = shape_coordinates(EFFECTS["wheel-flexibility"])  # a spring knows nothing of slip
    assert load.path == "wheel-flexibility.by_load"


def test_the_effect_that_acts_promises_most_and_keeps_it(dug, named):
    problem, soil = dug
    known, _ = effect_signatures(soil.fitted(), problem.readings, problem.effects)
    none = MarginalFit(soil, problem.discrepancy.evidence(soil))
    alone = Explanation((), none, none)
    gains = predicted_gains(problem, alone, alone.objective, known)
    assert max(gains, key=gains.get) == "slip-sinkage"
    assert alone.objective - named.objective > 0.5 * gains["slip-sinkage"] > 10.0
    assert named.fit.values()["slip-sinkage.n1"] == pytest.approx(0.4, abs=0.02)


def test_the_search_names_what_acts(dug):
    problem, soil = dug
    found = search(problem, soil, 0)
    assert found.has_gap and found.adequate
    assert [c.names for c in found.accepted] == [("slip-sinkage",)]
    assert found.posterior.probability("slip-sinkage") > 0.89
    assert found.likeliest.names == ("slip-sinkage",)
    assert np.all(found.likeliest.amplitude < 0.5)  # nothing is left for a discrepancy


def test_the_search_looks_no_further_where_nothing_is_missing():
    case = case_of()
    problem = small(fit_problem(case, driven(case, seed=5)))
    found = search(problem, problem.fit_soil([np.full(3, 0.5)]), 0)
    assert not found.has_gap
    assert found.accepted == found.candidates == ()


def test_a_larger_set_gives_way_to_a_smaller_that_explains_as_much(dug, named):
    problem, soil = dug
    pair = fitted(problem, soil, "bulldozing", "slip-sinkage")
    assert pair.objective > named.objective
    none = MarginalFit(soil, problem.discrepancy.evidence(soil))
    candidates = (pair, named, Explanation((), none, none))
    found = for_decisions(candidates, {}, candidates[-1])
    assert [c.names for c in explanations(candidates, found)] == [("slip-sinkage",)]


@pytest.mark.slow
def test_a_set_of_which_each_is_needed_stays():
    case = case_of()
    both = [DIGGING(n1=0.4), EFFECTS["bulldozing"](share=1.0)]
    problem = small(fit_problem(case, driven(case, both, seed=3)))
    found = search(problem, problem.fit_soil([np.full(3, 0.5)]), 0)
    assert [c.names for c in found.accepted] == [("bulldozing", "slip-sinkage")]


def test_the_true_model_leaves_nothing_of_readings_without_noise(dug):
    case = case_of()
    problem = fit_problem(case, driven(case, noise=0.0))
    truth = problem.readings.measured
    found = gap_reduction(
        problem.readings, problem.readings.std, truth + 3.0 * problem.readings.std, truth, "all"
    )
    assert found.before == pytest.approx(9.0) and found.after == 0.0
    assert set(found.channels) == {"torque_Nm", "drawbar_pull_N", "sinkage_m"}
    parts = held_out_folds(problem.readings, 0)
    assert set(parts) == {"held_out_runs", "held_out_region"}
    soil = problem.fit_soil([np.full(3, 0.5)])
    for name, found in predict_parts(problem, [(soil, np.zeros(3))], parts)[0].items():
        own = parts[name].selected
        assert np.isnan(found.mean[~own]).all()
        assert squares(problem, found, own) < 0.05


def test_the_right_model_leaves_the_noise_and_the_soil_alone_more(dug, named):
    problem, soil = dug
    parts = held_out_folds(problem.readings, 0)
    assert parts["held_out_region"].description == "load_N >= 140, predicted from the rest"
    none = np.zeros(3)
    before, after = predict_parts(problem, [(soil, none), (named.fit, none)], parts)
    for name, folds in parts.items():
        left = squares(problem, after[name], folds.selected)
        assert 0.5 < left < 1.8  # about 1, less a parameter's worth
        assert squares(problem, before[name], folds.selected) > 10.0 * left
        assert after[name].log_density > before[name].log_density + 100.0


def squares(problem, found, own):
    """Mean squared standardised residual of the readings of a part."""
    left = (problem.readings.measured - found.mean)[own] / problem.covariance.std[own]
    return np.mean(left**2)


@pytest.mark.parametrize("amplitude", [0.0, 3.0])
def test_the_variance_of_rows_held_out_is_that_of_a_linear_gaussian_model(dug, amplitude):
    problem, soil = dug
    parts = {"held_out_region": held_out_folds(problem.readings, 0)["held_out_region"]}
    own = np.full(3, amplitude)
    found = predict_parts(problem, [(soil, own)], parts)[0]["held_out_region"]
    out = parts["held_out_region"].selected
    rest = ~out
    known = problem.discrepancy.of_readings(rest, problem.readings.run[problem.readings.row])
    kept = LeastSquaresProblem(
        soil.case, soil.coordinates, problem.readings.subset(rest), known.whiten(own)
    )
    (fit,) = descend_together([kept], [soil.x])
    at = linearise(fit.case, fit.coordinates, fit.x, problem.readings)
    joint = problem.discrepancy.matrix(own) + at.jacobian @ at.jacobian.T / 12.0
    gain = joint[np.ix_(out, rest)] @ np.linalg.inv(joint[np.ix_(rest, rest)])
    covariance = joint[np.ix_(out, out)] - gain @ joint[np.ix_(rest, out)]
    assert found.std[out] == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-3)
    normal = multivariate_normal(found.mean[out], covariance)
    expected = normal.logpdf(problem.readings.measured[out])
    assert found.log_density == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("scatter, region", [(0.08, "slip >= "), (0.0, "load_N >= 90,")])
def test_the_held_out_region_lies_between_levels(scatter, region):
    case = case_of()
    one_level = 20.0 * (1.0 + np.random.default_rng(5).uniform(-scatter, scatter, 6))
    loads = tuple(one_level) if scatter else (40.0, 41.0, 60.0, 61.0, 90.0, 91.0)
    problem = fit_problem(case, driven(case, noise=0.0, slips=6, loads=loads))
    found = held_out_folds(problem.readings, 0)["held_out_region"]
    assert found.description.startswith(region)


def test_rows_that_took_no_part_are_predicted_as_well(dug, named):
    problem, soil = dug
    other = fit_problem(
        problem.case, driven(problem.case, [DIGGING(n1=0.4)], loads=(75.0, 170.0), seed=9)
    )
    found = predict_held_out(problem, soil, named.fit, other.readings, "others")
    assert found.readings == len(other.readings)
    assert 0.4 < found.after < 2.0 < found.before
    # noise that is a share of the reading is that of the prediction, whatever the reading was
    strayed = replace(other.readings, std=2.0 * other.readings.std)
    assert predict_held_out(problem, soil, named.fit, strayed, "others") == found
    unsure = replace(other.readings, slip_std=np.full_like(other.readings.slip_std, 0.02))
    assert predict_held_out(problem, soil, named.fit, unsure, "").after < 0.9 * found.after


def test_a_prediction_without_equilibrium_counts_as_ten_sigma(dug):
    readings = dug[0].readings
    nowhere = np.full(len(readings), np.nan)
    assert gap_reduction(readings, readings.std, nowhere, readings.measured, "all").before == 100.0


@pytest.mark.slow
def test_two_forms_of_one_law_are_never_in_one_set():
    case = case_of()
    hidden = [EFFECTS["hyperbolic-shear"](share=1.0), EFFECTS["torque-offset"](offset=0.2)]
    problem = fit_problem(case, driven(case, hidden, seed=4))
    names = ("shear-softening", "hyperbolic-shear", "torque-offset", "drawbar-offset")
    problem = replace(problem, effects={name: EFFECTS[name] for name in names})
    soil = problem.fit_soil([np.full(3, 0.5)])
    softening = fitted(problem, soil, "shear-softening").fit
    assert set(problem.effects_not_in(softening)) == {"torque-offset", "drawbar-offset"}
    sets = [c.names for c in search(problem, soil, 0).candidates]
    assert any(len(chosen) > 1 and "hyperbolic-shear" in chosen for chosen in sets)
    assert not any({"shear-softening", "hyperbolic-shear"} <= set(chosen) for chosen in sets)
