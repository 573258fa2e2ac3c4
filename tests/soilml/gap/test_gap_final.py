"""What is rejected, how probable sets are, and when a fit and an analysis are final."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml.gap.evidence.covariance import RUN_EFFECT_UNITS, VarianceComponents
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit, _changed
from soilml.gap.search import passes
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.posterior import (
    LOG_UNTRIED,
    Posterior,
    explanations,
    for_decisions,
    not_rejected,
    posterior,
)


def made(*names, objective=0.0):
    """A candidate with this objective."""
    none = np.zeros(2)
    evidence = Evidence(objective, none, np.zeros(0), none)
    marginal = MarginalFit(SimpleNamespace(objective=objective), evidence)
    return Explanation(names, marginal, marginal)


def test_sets_more_than_14_above_the_best_set_are_rejected():
    sets = [made("a", objective=0.0), made("b", objective=13.9), made("c", objective=14.1)]
    kept = not_rejected([made(objective=-50.0), *reversed(sets)])
    assert [c.names for c in kept] == [("a",), ("b",)]


def test_a_set_of_which_a_part_is_not_rejected_is_left_out():
    sets = [made("a", "b", objective=0.0), made("a", objective=5.0), made("b", objective=20.0)]
    assert [c.names for c in not_rejected(sets)] == [("a",)]


@pytest.mark.parametrize(
    "rivals, chance, alone", [(0, 0.011, 1), (0, 0.009, 0), (1, 0.21, 1), (1, 0.19, 0)]
)
def test_the_soil_alone_explains_unless_it_is_improbable(rivals, chance, alone):
    """A single explanation is named below one in a hundred, several are listed below a fifth."""
    sets = [made("a", objective=0.0), made("b", objective=1.0)][: 1 + rivals]
    empty = made(objective=3.0)
    rest = (1.0 - chance) / len(sets)
    log_weights = {c.names: float(np.log(rest)) for c in sets} | {(): float(np.log(chance))}
    kept = explanations([empty, *sets], Posterior(log_weights))
    assert [c.names for c in kept] == ([()] if alone else [c.names for c in sets])


def test_probabilities_are_those_of_tempered_differences_of_the_evidence():
    """Tempering T: odds of exp(-T difference / 2), with a smaller T for decisions.

    Stated odds of all sets of effects contain those of sets that were not tried, a factor of e - 1.
    """
    none = made(objective=10.0)
    sets, predicted = [none, made("a", objective=2.0)], {"a": 99.0, "b": 4.0, "c": np.nan}
    for found, half, untried in (
        (posterior(sets, predicted, none, dict.fromkeys("abc", 0.0)), 0.3, np.log(np.e - 1.0)),
        (for_decisions(sets, predicted, none), 0.25, 0.0),
    ):
        assert set(found.log_weights) == {(), ("a",), ("b",)}
        assert sum(np.exp(v) for v in found.log_weights.values()) == pytest.approx(1.0)
        odds = {names: own - found.log_weights[()] for names, own in found.log_weights.items()}
        assert odds["a",] == pytest.approx(half * 8.0 + untried)
        assert odds["b",] == pytest.approx(half * 4.0 + untried)
        assert found.effects() == ["a", "b"]


def test_prior_odds_are_not_tempered():
    """An objective of 2 is evidence of -4 and prior odds of 1 to e^3."""
    none = made(objective=10.0)
    found = posterior([none, made("a", objective=2.0)], {"b": 4.0}, none, {"a": 6.0, "b": 8.0})
    odds = {
        names: own - found.log_weights[()] - LOG_UNTRIED for names, own in found.log_weights.items()
    }
    assert odds["a",] == pytest.approx(0.3 * 14.0 - 3.0)
    assert odds["b",] == pytest.approx(0.3 * 12.0 - 4.0)


def test_rows_that_say_nothing_leave_the_prior_probabilities():
    """Of ten effects: no cause exp(-1), each of them a tenth of the rest, but for other causes."""
    effects = [f"effect-{i}" for i in range(10)]
    penalties = dict.fromkeys(effects, 2.0 * np.log(10.0))
    none = made(objective=10.0)
    found = posterior([none], {n: -penalties[n] for n in effects}, none, penalties)
    assert found.weight(()) == pytest.approx(np.exp(-1.0))
    share, before = (1.0 - np.exp(-1.0)) / 10.0, 1.0 / 11.0
    for name in effects:
        assert found.probability(name) == pytest.approx(0.97 * share + 0.03 * before)


@pytest.mark.parametrize(
    "before, after, changed",
    [
        ([0.0, 0.0], [0.0, 0.29], False),
        ([0.0, 0.0], [0.0, 0.31], True),
        ([0.31, 0.0], [0.0, 0.0], True),
        ([2.0, 1.0], [1.45, 1.0], False),
        ([2.0, 1.0], [1.35, 1.0], True),
    ],
)
def test_a_fit_is_repeated_where_an_amplitude_changed_by_more_than_it_matters(
    before, after, changed
):
    assert _changed(np.asarray(before), np.asarray(after)) == changed


@pytest.mark.parametrize(
    "scale, angle, bearing, rho, converged",
    [
        (1.0, 0.0, 0.0, 0.0, True),
        (1.0 / 1.19, 0.29, -0.29, 0.0, True),
        (1.0 / 1.21, 0.0, 0.0, 0.0, False),
        (1.0 / 0.79, 0.0, 0.0, 0.0, False),
        (1.0, 0.31, 0.0, 0.0, False),
        (1.0, -0.31, 0.0, 0.0, False),
        (1.0, 0.0, -0.31, 0.0, False),
        (1.0, 0.0, 0.31, 0.0, False),
        (1.0, 0.0, 0.0, 0.25, False),
    ],
)
def test_variance_components_have_converged_where_weights_hardly_change(
    scale, angle, bearing, rho, converged
):
    def components(scale, angle, bearing, rho):
        angle, bearing = angle * RUN_EFFECT_UNITS["friction_angle"], bearing * 0.05
        return VarianceComponents(np.asarray([1.0, scale]), angle, bearing, rho, 1.0)

    last, new = (
        components(1.0, 2.0, 2.0, 0.5),
        components(scale, 2.0 + angle, 2.0 + bearing, 0.5 + rho),
    )
    assert passes._have_converged(last, new) == converged
