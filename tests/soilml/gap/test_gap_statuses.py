"""The status of a report, from searches that are made up: each rule and its limit."""

from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import remark

from soilml.fitting.coordinates import Coordinate
from soilml.gap.evidence.marginal_likelihood import LARGEST_SIZE, Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.report.sentences import NOT_DECISIVE
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.posterior import (
    MAX_CHANCE_CLASS,
    MAX_CHANCE_NAME,
    REJECTION_THRESHOLD,
    Posterior,
    explanations,
    not_rejected,
)
from soilml.gap.search.stepwise import SearchResult
from soilml.gap.verdict import decision
from soilml.gap.verdict.decision import (
    DECISIVE_GAIN,
    LARGE_BESIDE_NAME,
    LARGE_REMAINDER,
    MAX_SIZE_DEVIATION,
    NAME_GAIN,
    SUSPECT_MARGIN,
    cause_set,
    decide,
    is_left_open,
    reasons,
    unclaimed_effects,
    with_refused_outside,
)
from soilml.gap.verdict.entries import candidate_summaries
from soilml.numerics.prior import Prior

PROBLEM = SimpleNamespace(readings=SimpleNamespace(channels=("torque", "drawbar_pull")))
REJECTED, KEPT = SimpleNamespace(p_value=1e-9), SimpleNamespace(p_value=0.5)


def size(effect, is_shape=False):
    prior = Prior(0.0, 1.0)
    return Coordinate(f"{effect}.n1", "1", prior, lower=-99.0, upper=99.0, is_shape=is_shape)


def marginal(value, amplitude=(0.0, 0.0), coordinates=(), x=()):
    precision = np.ones(len(x))
    fit = SimpleNamespace(coordinates=list(coordinates), x=np.asarray(x), precision=precision)
    amplitude = np.asarray(amplitude, dtype=float)
    return MarginalFit(fit, Evidence(value, amplitude, np.zeros(len(x)), amplitude))


def candidate(names, objective, amplitude=(0.0, 0.0), **fit):
    """A candidate whose objective, the penalty of its effects included, is that given."""
    names = tuple(names.split("+")) if names else ()
    own = marginal(objective, amplitude, **fit)
    return Explanation(names, own, own)


def searched(*candidates, accepted=1, adequate=True, gap=True, weights=None):
    """A search with these candidates, of which the first ones with effects are accepted."""
    with_effects = [c for c in candidates if c.names]
    weights = weights or {c.names: -0.5 * c.objective for c in candidates}
    total = np.logaddexp.reduce(list(weights.values()))
    return SearchResult(
        soil=None,
        soil_test=REJECTED if gap else KEPT,
        accepted=tuple(with_effects[:accepted]),
        candidates=candidates,
        final_test=KEPT if adequate else REJECTED,
        predicted_gain={},
        posterior=Posterior({n: own - total for n, own in weights.items()}),
    )


NONE = candidate("", 100.0, amplitude=(0.5, 0.0))
DIG, PLOUGH = candidate("dig", 20.0), candidate("plough", 22.0)


def status(result, obstacles=(), disagreements=()):
    return decide(PROBLEM, result, obstacles, disagreements).status


@pytest.fixture
def law(monkeypatch):
    """Whether the law of an effect matters."""
    found = SimpleNamespace(matters=True)
    monkeypatch.setattr(decision, "law_matters", lambda problem, best: found.matters)
    return found


def test_without_a_gap_what_disagrees_decides():
    quiet = searched(NONE, DIG, gap=False)
    assert status(quiet) == "no-gap"
    assert status(quiet, ["one load only"]) == "no-gap"
    assert status(quiet, disagreements=[remark("runs differ")]) == "undecided"


@pytest.mark.parametrize(
    ("none", "effects", "left_open"),
    [
        (candidate("", 20.0), [candidate("dig", 20.0)], True),  # the effect is no better
        (candidate("", 20.1), [candidate("dig", 20.0)], False),
        (candidate("", 10.0, amplitude=(0.0, 0.1)), [candidate("dig", 20.0)], False),
        (candidate("", 20.0), [], True),
    ],
)
def test_a_rejected_soil_without_anything_better_is_left_open(none, effects, left_open):
    result = searched(none, *effects)
    assert is_left_open(result) == left_open
    assert (status(result) == "undecided") == left_open
    assert not is_left_open(searched(none, *effects, gap=False))


def test_one_explanation_is_named_and_several_are_a_class():
    assert status(searched(NONE, DIG)) == "named"
    assert status(searched(NONE, DIG, PLOUGH, accepted=2)) == "class"
    assert status(searched(NONE, DIG, adequate=False)) == "partly-named"
    # a class says nothing of what is left
    assert status(searched(NONE, DIG, PLOUGH, accepted=2, adequate=False)) == "class"


def test_runs_that_cannot_tell_have_suspects_or_nothing():
    assert SUSPECT_MARGIN != 0.0
    for above, found in ((-0.01, "suspected"), (0.01, "not-testable")):
        none = candidate("", 50.0, amplitude=(0.5, 0.0))
        effect = candidate("dig", 50.0 + SUSPECT_MARGIN + above)
        assert status(searched(none, effect), ["one load only"]) == found


def test_where_the_soil_alone_is_not_rejected_effects_are_suspects_if_they_are_likelier():
    likelier = candidate("", 20.5, amplitude=(0.5, 0.0))
    for none, found in ((likelier, "suspected"), (candidate("", 19.5, (0.5, 0.0)), "unknown")):
        result = searched(none, DIG, accepted=0)
        assert status(result) == found
        beside = searched(none, DIG)
        beside = SearchResult(**{**vars(beside), "accepted": (DIG, none)})
        assert status(beside) == found


def test_a_fault_of_an_implausible_size_is_not_claimed():
    for x, found in ((0.99, "named"), (1.01, "unknown")):
        far = candidate("dig", 20.0, coordinates=[size("dig")], x=[-x * MAX_SIZE_DEVIATION])
        made = decide(PROBLEM, searched(NONE, far), (), ())
        assert made.status == found
        assert (made.reason is not None) == (found == "unknown")
    assert (made.reason.code, made.reason.about) == ("implausible-fault", ("dig",))


def test_an_implausible_size_is_suspected_after_an_explanation_of_a_usual_size():
    def found(x, *rivals):
        far = candidate("dig", 20.0, coordinates=[size("dig")], x=[x])
        far.fit.precision[:] = 0.01  # no fault of a sensor, whose size has a narrow prior
        result = with_refused_outside(PROBLEM, searched(NONE, far, *rivals), {})
        return decide(PROBLEM, result, (), ()), result.posterior

    assert found(0.99 * LARGEST_SIZE)[0].status == "named"
    made, chances = found(1.01 * LARGEST_SIZE, candidate("plough", 29.0))
    assert (made.status, made.shown.names) == ("suspected", ("plough",))
    assert (made.reason.code, made.reason.about) == ("implausible-size", ("dig",))
    assert chances.probability("dig") > chances.probability("plough")
    hopeless, chances = found(1.01 * LARGEST_SIZE, candidate("plough", 48.0))
    assert (hopeless.status, hopeless.shown.names) == ("suspected", ("dig",))
    assert not chances.is_stated(("plough",))
    assert found(1.01 * LARGEST_SIZE)[0].status == "unknown"  # nothing else can come first


def test_an_implausible_fault_is_the_reason_also_where_no_other_effect_is_suspected():
    far = candidate("dig+plough", 20.0, coordinates=[size("dig"), size("plough")], x=[9.0, 1.0])
    result = with_refused_outside(PROBLEM, searched(NONE, far), {})
    assert result.likeliest_suspect is None
    made = decide(PROBLEM, result, (), ())
    assert (made.status, made.reason.about) == ("unknown", ("dig",))


@pytest.mark.parametrize(
    ("names", "limit"),
    [("dig", "MAX_SHAPE_DEVIATION"), ("dig+plough", "MAX_SHAPE_DEVIATION_SEVERAL")],
)
def test_a_law_far_from_the_catalogues_is_suspected(names, limit):
    most = getattr(decision, limit)
    for share, found in ((0.99, "named"), (1.01, "suspected")):
        x = np.sqrt(share * most)
        own = candidate(names, 20.0, coordinates=[size("dig", is_shape=True)], x=[x])
        made = decide(PROBLEM, searched(NONE, own), (), ())
        assert (made.status, made.shown) == (found, own)
        assert (made.reason is not None) == (found == "suspected")


def test_a_large_remainder_beside_little_evidence_is_suspected():
    def found(amplitude, gain):
        best = candidate("dig", 20.0, amplitude=(0.1, amplitude))
        none = candidate("", 20.0 + gain, amplitude=(5.0, 5.0))
        return decide(PROBLEM, searched(none, best), (), ())

    for amplitude, gain, expected in (
        (LARGE_REMAINDER, DECISIVE_GAIN - 0.1, "suspected"),
        (LARGE_BESIDE_NAME, NAME_GAIN - 0.1, "suspected"),
        (LARGE_BESIDE_NAME - 0.01, NAME_GAIN - 0.1, "named"),
        (LARGE_BESIDE_NAME, NAME_GAIN, "named"),
    ):
        made = found(amplitude, gain)
        assert made.status == expected
        assert (made.reason is not None) == (expected == "suspected")
        assert made.reason is None or made.reason.about == ("dig", "drawbar_pull_N")


def test_a_class_may_leave_more_than_a_name():
    sets = [candidate(n, 20.0, amplitude=(LARGE_BESIDE_NAME, 0.1)) for n in ("dig", "plough")]
    none = candidate("", 20.0 + DECISIVE_GAIN, amplitude=(5.0, 5.0))
    assert decide(PROBLEM, searched(none, *sets, accepted=2), (), ()).status == "class"
    assert decide(PROBLEM, searched(none, sets[0]), (), ()).status == "suspected"


def test_beside_a_large_remainder_the_first_suspect_is_shown_and_why_not_the_best():
    best = candidate("dig", 20.0, amplitude=(LARGE_REMAINDER, 0.1))
    none = candidate("", 20.0 + DECISIVE_GAIN - 1.0, amplitude=(5.0, 5.0))
    words = "beside dig, at least four times the usual error of a model is left in the torque"
    made = decide(PROBLEM, searched(none, best, PLOUGH), (), ())
    assert (made.shown, made.reason.text) == (best, words)
    weights = {(): -9.0, ("dig",): -2.0, ("plough",): -1.0}
    made = decide(PROBLEM, searched(none, best, PLOUGH, weights=weights), (), ())
    assert made.status == "suspected" and made.shown is PLOUGH
    assert made.reason.text == f"{words}, and the evidence for plough is not decisive"


def test_another_law_is_stated_where_it_matters(law):
    one, other = marginal(15.0), marginal(20.0)
    free = Explanation(("dig",), other, one)
    assert status(searched(NONE, free)) == "form-open"
    assert decide(PROBLEM, searched(NONE, free), (), ()).shown is free
    law.matters = False
    assert status(searched(NONE, free)) == "named"
    law.matters = True
    assert status(searched(NONE, Explanation(("dig",), one, one))) == "named"
    assert status(searched(NONE, free, adequate=False)) == "partly-named"


def test_an_effect_on_one_channel_is_not_named_by_another_law_alone(law, monkeypatch):
    """What the catalogue's law explains less well than the soil alone is no name by its law."""
    alone = {"dig": "drawbar_pull"}
    monkeypatch.setattr(decision, "only_channels", lambda problem, result: alone)
    for by_catalogue, expected in ((99.9, "form-open"), (100.0, "suspected")):
        free = Explanation(("dig",), marginal(by_catalogue), marginal(15.0))
        made = decide(PROBLEM, searched(NONE, free), (), ())
        assert made.status == expected
        assert (made.reason and made.reason.code) == (None if made.claimed else "other-law")
    assert with_refused_outside(PROBLEM, searched(NONE, free), {}).posterior.refused
    alone.clear()  # where several channels show it, their relation identifies it
    assert status(searched(NONE, free)) == "form-open"


def test_a_name_has_a_probability_of_nine_tenths():
    for chance, expected in ((0.94, "named"), (0.92, "suspected")):
        weights = {("dig",): np.log(chance), ("plough",): np.log(1.0 - chance)}
        made = decide(PROBLEM, searched(NONE, DIG, weights=weights), (), ())
        assert made.status == expected and made.shown is DIG


def test_what_is_shown_is_the_suspect_that_is_listed_first():
    """An effect that was not fitted in full is passed over; other sets count towards theirs."""
    weights = {(): -5.0, ("dig",): -1.0, ("plough",): -2.0, ("unfitted",): -0.5}
    result = searched(NONE, PLOUGH, DIG, accepted=0, weights=weights)
    made = decide(PROBLEM, result, (), ())
    assert (made.status, made.shown) == ("suspected", DIG)
    assert unclaimed_effects(made, result) == ("dig",)
    assert cause_set(made, result) == (("dig",), ("plough",))
    named = decide(PROBLEM, searched(NONE, DIG), (), ())
    assert unclaimed_effects(named, searched(NONE, DIG)) == ()
    assert cause_set(named, searched(NONE, DIG)) == (("dig",),)
    quiet = searched(NONE, PLOUGH, DIG, gap=False)
    assert unclaimed_effects(decide(PROBLEM, quiet, (), ()), quiet) == ("plough",)


def test_reasons_by_status():
    suspected = decide(PROBLEM, searched(NONE, DIG, accepted=0), (), ())
    assert reasons(suspected, [], []) == ()
    load, two, more = remark("one load only"), remark("a and b"), remark("c and d")
    assert reasons(suspected, [load], []) == (load,)
    first, second = reasons(suspected, [], [two, more])
    assert first == NOT_DECISIVE
    assert (second.code, second.text) == ("a and b", "replicate rows disagree: a and b")
    assert reasons(suspected, [load], [two])[0] == load
    undecided = decide(PROBLEM, searched(NONE, gap=False), (), [two])
    assert reasons(undecided, [load], [two]) == (two,)
    testless = decide(PROBLEM, searched(candidate("", 1.0, (1.0, 0.0)), DIG), [load], ())
    assert reasons(testless, [load], [two]) == (load,)
    assert reasons(decide(PROBLEM, searched(NONE, DIG), (), ()), [], []) == ()


def test_rejection_is_against_the_best_and_parts_stand_for_their_sets():
    near = candidate("plough", 20.0 + REJECTION_THRESHOLD)
    far = candidate("slope", 20.01 + REJECTION_THRESHOLD)
    pair = candidate("dig+slope", 15.0)
    assert not_rejected([NONE, DIG, near, far]) == (DIG, near)
    assert not_rejected([NONE, pair, DIG]) == (DIG,)
    assert not_rejected([NONE]) == ()


@pytest.mark.parametrize(
    ("others", "limit"), [((), MAX_CHANCE_NAME), ((PLOUGH,), MAX_CHANCE_CLASS)]
)
def test_the_soil_alone_is_an_explanation_unless_it_is_improbable(others, limit):
    for share, expected in ((0.99, False), (1.01, True)):
        chance = share * limit
        found = Posterior({(): np.log(chance), ("dig",): np.log(1.0 - chance)})
        kept = explanations([NONE, DIG, *others], found)
        assert any(not c.names for c in kept) == expected
        if expected:  # it is a part of every set
            assert kept == (NONE,)


def test_refused_explanations_lend_their_parts_that_are_accepted():
    """What is refused of a pair is its supplement, where one of its effects is accepted alone."""
    far = [size("plough")], [2.0 * MAX_SIZE_DEVIATION]
    pair = candidate("dig+plough", 18.0, coordinates=far[0], x=far[1])
    alone = candidate("plough", 21.0, coordinates=far[0], x=far[1])
    result = searched(NONE, DIG, pair, alone)
    found = with_refused_outside(PROBLEM, result, {}).posterior.refused
    assert found == {("dig", "plough"): frozenset({"dig"}), ("plough",): frozenset()}
    assert with_refused_outside(PROBLEM, searched(NONE, DIG), {}).posterior.refused == {}


def test_candidates_are_summarised_against_the_soil_alone_and_the_best():
    slow = candidate("slope", 21.0)
    slow.catalogue_law.fit.converged = False
    for one in (DIG, PLOUGH):
        one.catalogue_law.fit.converged = True
    far, pair = candidate("rate", 60.0), candidate("dig+plough", 19.0)
    far.catalogue_law.fit.converged = pair.catalogue_law.fit.converged = True
    result = searched(NONE, DIG, PLOUGH, slow, far, pair)
    object.__setattr__(result, "predicted_gain", {"dig": 70.0})
    found = candidate_summaries(SimpleNamespace(result=result), claimed=True)
    rows = [
        (c.effects, c.predicted_gain, c.achieved_gain, c.excess, str(c.verdict)) for c in found[:4]
    ]
    assert rows == [
        (("dig",), 70.0, 80.0, 1.0, "explains the data"),
        (("plough",), 0.0, 78.0, 3.0, "more effects than needed"),
        (("slope",), 0.0, 79.0, 2.0, "fit did not converge: no evidence"),
        (("rate",), 0.0, 40.0, 41.0, "rejected against the best"),
    ]
    assert found[4].excess == 0.0 and np.isnan(found[4].predicted_gain)
    unclaimed = candidate_summaries(SimpleNamespace(result=result), claimed=False)
    assert [str(c.verdict) for c in unclaimed[:2]] == [
        "fits best, not claimed",
        "not rejected, not claimed",
    ]
