"""Decisions of the search, one by one: what is selected, fitted again, extended and rejected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.search import screening, stepwise
from soilml.gap.search.explanation import Explanation


def fit_of(objective=0.0, x=None):
    """What the decisions see of a fit."""
    start = x or {}
    return SimpleNamespace(
        objective=objective,
        fitted=lambda: None,
        start_values=lambda: dict(start),
        linearisation=None,
    )


def made(*names, objective=0.0, amplitude=(0.0, 0.0), noise_only=None, x=None):
    """A candidate with this objective and discrepancy."""
    known = np.asarray(amplitude, dtype=float)
    evidence = Evidence(objective, known, np.zeros(0), known)
    marginal = MarginalFit(fit_of(objective, x), evidence)
    return Explanation(names, marginal, marginal, noise_only)


@pytest.fixture
def screens(monkeypatch):
    """Gains by a law of one's own, of two fits beside the discrepancy, and under noise alone.

    Last, those by the catalogue's law under noise alone.
    """
    given = {"none": {}, "soil": {}, "own": {}, "noise": {}}

    def own_law(problem, amplitude, fit, signatures):
        if fit.objective:
            return given["none"]
        return given["soil" if amplitude.any() else "own"]

    monkeypatch.setattr(screening, "free_law_gains", own_law)
    monkeypatch.setattr(screening, "noise_only_gains", lambda problem, soil, s: given["noise"])
    return given


def likely(gains, amplitude=(0.1, 0.0), starts=None, without_gain=frozenset(), few=False):
    none = made(objective=1.0, amplitude=amplitude)
    problem = SimpleNamespace(penalties=dict.fromkeys(gains, 7.0))
    return screening.effects_to_fit(
        problem, none, fit_of(), [], gains, starts or {}, without_gain, few=few
    )


def selected(gains, **given):
    return list(likely(gains, **given))


def test_effects_within_12_of_the_largest_gain_are_fitted_at_least_four_at_most_nine(screens):
    gains = {"a": 50.0, "b": 49.0, "c": 45.0, "d": 39.0, "e": 38.5, "f": 37.5, "g": 1.0}
    assert selected(gains) == list("abcde")
    assert selected({"a": 50.0, "b": 1.0, "c": 4.0, "d": 3.0, "e": 2.0}) == list("acde")
    many = {name: 50.0 - i for i, name in enumerate("abcdefghijkl")}
    assert selected(many) == list("abcdefghi")
    assert selected({"b": 3.0, "a": 7.0}) == ["a", "b"]


def test_an_effect_that_explained_nothing_is_fitted_again_only_where_it_should_gain_now(screens):
    alone, kept = made(objective=50.0), made("c", objective=55.9)
    fitted = {c.names: c for c in (alone, made("b", objective=56.1), kept, made("a", "b"))}
    problem = SimpleNamespace(penalties={"b": 7.0, "c": 7.0})
    assert screening.explained_nothing(problem, fitted) == {"b"}  # it gains 0.9 of its penalty
    assert selected({"b": -6.1, "c": -6.0}, starts=fitted, without_gain={"b"}) == ["c"]
    assert selected({"b": -5.9, "c": -7.0}, starts=fitted, without_gain={"b"}) == ["b", "c"]
    assert selected({"b": -6.3, "c": -6.5}, starts=fitted, without_gain={"b", "c"}) == ["b"]


def test_six_more_are_those_that_explain_most_by_their_own_law(screens):
    gains = {"a": 50.0} | dict.fromkeys("bcd", 2.0) | dict.fromkeys("ABCDEFGHPQRSTUVW", 0.0)
    screens["none"] = {name: 20.0 - i for i, name in enumerate("ABCDEFGH")}
    screens["soil"] = {name: 20.0 - i for i, name in enumerate("PQRSTUVW")} | {"unknown": 99.0}
    assert selected(gains) == [*"abcd", *"ABCDEF", *"PQRST"]


@pytest.mark.parametrize("largest, hidden", [(2.4, False), (2.5, True)])
def test_beside_a_large_discrepancy_those_that_explain_most_under_noise_too(
    screens, largest, hidden
):
    gains = dict.fromkeys("abcd", 50.0) | dict.fromkeys("ABCDEFGH", 0.0)
    screens["noise"] = {name: 20.0 - i for i, name in enumerate("ABCDEFGH")}
    found = selected(gains, amplitude=(0.1, largest))
    assert found == [*"abcd", *("ABCDEF" if hidden else "")]


def test_the_first_six_of_those_start_under_noise_too_and_those_close_by_their_own_law(screens):
    gains = dict.fromkeys("abcd", 50.0) | dict.fromkeys("ABCDEFGHPQRS", 0.0)
    screens["noise"] = {name: 20.0 - 0.1 * i for i, name in enumerate("ABCDEFGH")}
    screens["soil"] = {name: 20.0 - i for i, name in enumerate("PQRS")}
    screens["own"] = {"S": 50.0, "P": 40.1, "Q": 39.9, "unselected": 45.0}
    found = likely(gains, amplitude=(2.5, 0.0), starts={("B",): made("B", objective=90.0)})
    assert list(found) == [*"abcd", *"PQRS", *"ABCDEFGH"]  # all explain four fifths of the most
    # one that an earlier search has fitted starts where that found it
    assert {name for name, also in found.items() if also} == set("ACDEF") | set("SP")
    assert not any(likely(gains, amplitude=(2.4, 0.0)).values())


def test_the_first_few_are_the_four_of_largest_gain_and_two_of_each_other_ranking(screens):
    gains = {name: 50.0 - i for i, name in enumerate("abcdef")} | dict.fromkeys("ABCPQRXYZ", 0.0)
    for ranking, names in {"none": "ABC", "soil": "PQR", "noise": "XYZ"}.items():
        screens[ranking] = {name: 20.0 - 9.0 * i for i, name in enumerate(names)}
    assert selected(gains, amplitude=(2.5, 0.0), few=True) == [*"abcd", *"ABPQXY"]
    assert selected(gains, amplitude=(2.5, 0.0)) == [*"abcdef", *"ABCPQRXYZ"]


def test_single_effects_within_15_of_the_best_of_an_earlier_search_are_fitted_again(screens):
    gains = dict.fromkeys("abcd", 50.0) | dict.fromkeys("xyz", -90.0)
    earlier = [
        made("x", "y", objective=-30.0),
        made("x", objective=-15.5),
        made("y", objective=-14.5),
        made("gone", objective=-20.0),
    ]
    assert selected(gains, starts={c.names: c for c in earlier}) == [*"abcd", "x"]


def test_a_first_look_takes_the_four_likeliest_sets_of_an_earlier_search():
    earlier = {
        c.names: c
        for c in [
            made("a", "b", objective=1.0),
            made("c", objective=2.0),
            made(objective=0.0),
            *(made(name, objective=9.0 + i) for i, name in enumerate("defg")),
        ]
    }
    assert screening.likeliest_sets(earlier) == [("a", "b"), ("c",), ("d",), ("e",)]


@pytest.fixture
def fitting(monkeypatch):
    """Requests that were made, what they give, what shapes promise, and what is shaped."""
    seen = SimpleNamespace(requests=[], results={}, promise={}, shaped=[])

    def fit_candidates(problem, requests, lowest=np.inf):
        seen.requests = requests
        return [seen.results[r.names] for r in requests if r.names in seen.results]

    def fit_shapes(problem, candidates, starts, limit):
        seen.starts, seen.limit = starts, limit
        seen.shaped = [c.names for c in candidates]
        return [replace(c, noise_only="shaped") for c in candidates]

    monkeypatch.setattr(stepwise, "fit_candidates", fit_candidates)
    monkeypatch.setattr(stepwise, "fit_shapes", fit_shapes)
    monkeypatch.setattr(
        stepwise, "predicted_shape_gain", lambda problem, c: seen.promise.get(c.names, 0.0)
    )
    return seen


def level(none, sets, starts=None, soil=None):
    return stepwise._fit_level(None, soil or fit_of(100.0), none, sets, starts or {})


def test_shapes_are_fitted_where_they_could_bring_a_set_to_the_best(fitting):
    none = made(objective=20.0)
    values = {"best": 0.0, "near": 14.9, "far": 15.1, "promises": 59.0, "too-little": 61.0}
    fitting.results = {(n,): made(n, objective=v) for n, v in values.items()}
    fitting.promise = {("promises",): 20.0, ("too-little",): 20.0}
    fitting.results["by-noise",] = made("by-noise", objective=70.0, noise_only=fit_of(79.0))
    fitting.results["not-by-noise",] = made("not-by-noise", objective=70.0, noise_only=fit_of(81.0))
    shaped_before = made("shaped-before", objective=70.0)
    fitting.results["shaped-before",] = shaped_before
    free_law = MarginalFit(shaped_before.fit, replace(shaped_before.best.evidence, value=69.0))
    earlier = {("shaped-before",): replace(shaped_before, free_law=free_law), ("far",): none}
    found = level(none, dict.fromkeys(fitting.results, none), earlier)
    named = ["best", "near", "promises", "by-noise", "shaped-before"]
    assert fitting.shaped == [(name,) for name in named]
    assert fitting.limit == 80.0
    assert fitting.starts == dict.fromkeys(fitting.results, none) | earlier  # what they extend
    assert [c.names for c in found] == list(fitting.results)  # in their order, shaped or not
    assert [c.names for c in found if c.noise_only == "shaped"] == fitting.shaped


def test_shapes_start_under_noise_up_to_twice_what_the_best_effect_leaves(fitting):
    left = {"best": 30.0, "twice": 59.0, "more": 61.0}
    fitting.results = {
        (n,): made(n, objective=20.0 * i, noise_only=fit_of(x))
        for i, (n, x) in enumerate(left.items())
    }
    level(made(objective=0.0), dict.fromkeys(fitting.results, made()))
    assert fitting.shaped == [("best",), ("twice",)] and fitting.limit == 60.0


def test_the_soil_alone_is_one_of_those_that_shapes_must_reach(fitting):
    fitting.results = {("a",): made("a", objective=16.0), ("b",): made("b", objective=14.0)}
    level(made(objective=0.0), dict.fromkeys(fitting.results, made()))
    assert fitting.shaped == [("b",)]


def test_where_the_model_refuses_all_sets_nothing_is_shaped(fitting):
    assert level(made(), {("a",): made()}) == []
    assert fitting.shaped == []


def test_a_set_starts_from_what_it_extends_or_from_an_earlier_search(fitting):
    base = made("a", amplitude=(2.0, 0.1), x={"soil": 0.2})
    none = made(amplitude=(1.0, 0.5), x={"soil": 0.9})
    earlier = made("a", "c", amplitude=(0.3, 0.0), x={"soil": 0.4})
    level(none, {("a", "b"): base, ("a", "c"): base}, {("a", "c"): earlier})
    first, second = fitting.requests
    assert first.names == ("a", "b") and first.start == {"soil": 0.2}
    assert first.amplitude.tolist() == [1.0, 0.1] and first.noise_start is None
    assert second.start == {"soil": 0.4} and second.amplitude.tolist() == [0.3, 0.0]


def test_single_effects_that_are_to_start_under_noise_too_do_so_nearer_to_the_middle(fitting):
    none, soil = made(), fit_of(0.0, {"cohesion": 1.0, "shear_modulus": 0.25})
    stepwise._fit_level(None, soil, none, {("a",): none, ("b",): none}, {}, {"a"})
    # nearer to the middle of the priors, since the soil alone is often at a bound
    inward = {"cohesion": pytest.approx(0.9), "shear_modulus": pytest.approx(0.3)}
    assert [r.noise_start for r in fitting.requests] == [inward, None]


@pytest.fixture
def extending(monkeypatch):
    """Gains by one more effect, by the names of the set."""
    gains = {}
    monkeypatch.setattr(
        stepwise, "predicted_gains", lambda problem, c, objective, s: gains.get(c.names, {})
    )
    return gains


def extensions(level, lowest=0.0):
    problem = SimpleNamespace(
        readings=None, signatures_beside=lambda fit: [], discrepancy=None, covariance=None
    )
    found = stepwise._extensions(problem, level, lowest)
    return {names: base.names for names, base in found.items()}


def test_the_best_three_sets_within_15_are_extended_by_the_best_three_effects(extending):
    values = {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0}
    sets = [made(n, objective=v) for n, v in reversed(values.items())]
    for name in values:
        extending[(name,)] = {"p": 1.0, "q": 9.0, "r": 5.0, "s": 0.5, "t": -3.0}
    found = extensions(sets)
    assert list(found) == [(n, e) for n in "abc" for e in ("q", "r", "p")]
    assert all(base == names[:1] for names, base in found.items())
    far = [made("a", objective=14.9), made("b", objective=15.1)]
    assert set(extensions(far).values()) == {("a",)}


def test_only_effects_with_enough_gain_extend_and_each_set_the_better_of_its_parts(extending):
    extending[("m",)] = {"a": -1.9, "b": -2.1, "z": 3.0}
    extending[("z",)] = {"m": 8.0, "y": 7.0}
    sets = [made("m", objective=0.0), made("z", objective=1.0)]
    assert extensions(sets) == {("m", "z"): ("m",), ("a", "m"): ("m",), ("y", "z"): ("z",)}


@pytest.mark.parametrize(
    "amplitude, p_value, complete",
    [((0.0, 0.0), 0.21, True), ((0.0, 0.0), 0.19, False), ((0.0, 0.1), 0.9, False)],
)
def test_a_set_is_complete_where_noise_explains_the_rest(monkeypatch, amplitude, p_value, complete):
    test, other = SimpleNamespace(p_value=p_value), SimpleNamespace(p_value=1.0 - p_value)
    monkeypatch.setattr(stepwise, "_test_residuals", lambda *_: test)
    best, alone = made("a", amplitude=amplitude), made(amplitude=amplitude)
    known = SimpleNamespace(accepted=(made("b"),), final_test=other)
    assert stepwise.is_complete(None, best, known, 0) == complete
    known = SimpleNamespace(accepted=(best,), final_test=test)
    monkeypatch.setattr(stepwise, "_test_residuals", lambda *_: other)
    assert stepwise.is_complete(None, best, known, 0) == complete
    assert not stepwise.is_complete(None, alone, known, 0)  # a gap was found


@pytest.fixture
def searched(monkeypatch):
    """A search of which each level of sets has a best objective; the levels that were fitted."""
    seen = SimpleNamespace(
        levels=[], objective={0: 100.0}, complete=None, p_value=0.001, again=None
    )
    seen.done = []

    def fit_level(problem, soil, none, sets, starts, under_noise=frozenset(), others=()):
        assert under_noise == ({"a"} if none in sets.values() else set())
        seen.levels.append(sorted(sets))
        size = len(next(iter(sets), ()))
        return [made(*n, objective=seen.objective[size]) for n in sets if size in seen.objective]

    def grown(problem, level, lowest):
        return {(*c.names, "abc"[len(c.names)]): c for c in level}

    for name, value in {
        "residual_test": lambda *_, **_kw: SimpleNamespace(p_value=seen.p_value, signatures=()),
        "_fit_soil_alone": lambda *_: made(objective=seen.objective[0]),
        "predicted_with_and_without": lambda *_: {"a": 5.0},
        "effects_to_fit": lambda *_, **__: {"a": True},
        "_from_soils_of": lambda problem, soil_alone, *_: seen.again or soil_alone,
        "_fit_level": fit_level,
        "_extensions": grown,
        "is_complete": lambda problem, best, known, seed: best.names == seen.complete,
        "_test_residuals": lambda *_: SimpleNamespace(p_value=seen.p_value),
    }.items():
        monkeypatch.setattr(stepwise, name, value)
    penalties = dict.fromkeys("abcdefgh", 0.0)
    problem = SimpleNamespace(
        penalties=penalties, signatures_and_untestable=lambda _: ((), ("lacking",))
    )

    def run():
        seen.levels, seen.done = [], []
        return stepwise.search(problem, fit_of(), 0, None, seen.done.append)

    return seen, run


def test_sets_of_up_to_three_effects_are_tried_while_each_is_better(searched):
    seen, run = searched
    seen.objective = {0: 100.0, 1: 50.0, 2: 40.0, 3: 30.0}
    found = run()
    assert seen.levels == [[("a",)], [("a", "b")], [("a", "b", "c")]]
    assert seen.done == [0.25, 0.5, 0.75]
    assert [c.objective for c in found.candidates] == [30.0, 40.0, 50.0, 100.0]
    assert found.soil_alone.names == () and found.likeliest.names == ("a", "b", "c")
    assert found.untestable == ("lacking",) and found.predicted_gain == {"a": 5.0}


@pytest.mark.parametrize("second, levels", [(49.5, 2), (48.5, 3)])
def test_larger_sets_are_tried_where_the_last_step_lowered_the_objective_by_one(
    searched, second, levels
):
    seen, run = searched
    seen.objective = {0: 100.0, 1: 50.0, 2: second, 3: 40.0}
    run()
    assert len(seen.levels) == levels


def test_the_search_ends_with_a_complete_set_or_one_that_the_model_refuses(searched):
    seen, run = searched
    seen.objective = {0: 100.0, 1: 50.0, 2: 40.0, 3: 30.0}
    seen.complete = ("a",)
    run()
    assert len(seen.levels) == 1
    seen.complete, seen.objective = None, {0: 100.0, 1: 50.0}
    run()
    assert len(seen.levels) == 2


@pytest.mark.parametrize("p_value, gap", [(0.029, True), (0.031, False)])
def test_a_gap_is_searched_where_the_soil_alone_is_rejected_at_3_per_cent(searched, p_value, gap):
    seen, run = searched
    seen.p_value, seen.objective = p_value, {0: 100.0, 1: 50.0}
    found = run()
    assert found.has_gap == bool(found.candidates) == gap
    assert found.untestable == ("lacking",) and (seen.done == []) == (not gap)
    if not gap:
        assert found.soil_alone is found.likeliest is None and found.accepted == ()


@pytest.mark.parametrize("p_value, adequate", [(0.0009, False), (0.0011, True)])
def test_an_explanation_leaves_a_remainder_from_one_in_a_thousand(searched, p_value, adequate):
    seen, run = searched
    seen.p_value, seen.objective = p_value, {0: 100.0, 1: 50.0}
    assert run().adequate == adequate


def test_a_better_optimum_of_the_soil_alone_takes_its_place(searched):
    seen, run = searched
    seen.objective |= {1: 60.0}
    assert run().soil_alone.objective == 100.0
    assert run().posterior.probability("a") > 0.9
    seen.again = made(objective=50.0)
    assert run().soil_alone is seen.again
    assert run().posterior.probability("a") < 0.2


def test_the_soil_alone_starts_from_the_soils_of_the_two_best_explanations(monkeypatch):
    started = []

    def fit_marginal(problem, fits, lowest):
        assert lowest == 50.0
        started.append(fits)
        return [made(objective=value).catalogue_law for value in objectives]

    monkeypatch.setattr(stepwise, "fit_marginal", fit_marginal)
    level = [made("a", objective=30.0), made("b", objective=10.0), made("c", objective=20.0)]
    problem, own = SimpleNamespace(case=None, soil=("the soil",)), made(objective=50.0)
    objectives = [49.95, 60.0]
    assert stepwise._from_soils_of(problem, own, level, {}) is own  # the same optimum again
    assert len(started[0]) == 2
    objectives = [60.0, 40.0]
    assert stepwise._from_soils_of(problem, own, level, {}).objective == 40.0
