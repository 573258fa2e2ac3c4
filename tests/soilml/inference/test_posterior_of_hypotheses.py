"""The posterior over what a model lacks: names, soil, optima, and rows kept back."""

from functools import cache

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven

from soilml.fitting.coordinates import free_soil_parameters
from soilml.fitting.readings import stack_readings
from soilml.inference.explanation import StartedFit
from soilml.inference.posterior import infer
from soilml.inference.problem import (
    SOIL_ALONE,
    Hypothesis,
    InferenceProblem,
    effect_penalties,
    exclude_each_other,
)
from soilml.physics.effects import EFFECTS

FEW = {n: EFFECTS[n] for n in ("slip-sinkage", "bulldozing", "exit-angle", "torque-gain")}


def problem(table, text=MODEL, effects=FEW):
    case = case_of(text)
    readings = stack_readings(case, table)
    return InferenceProblem(case, tuple(free_soil_parameters(case, None)), readings, effects, {})


@cache
def found(n1=0.0, strays=False, text=MODEL):
    effects = [EFFECTS["slip-sinkage"](n1=n1)] if n1 else []
    table = driven(case_of(), effects, slips=6, seed=2)
    if strays:
        table.columns["torque_Nm"][5] *= 1.6
    return infer(problem(table, text))


def test_without_an_effect_no_gap_is_likelier():
    own = found()
    assert own.no_gap > 0.5 and own.no_effect > 0.8
    assert sum(own.sets.values()) <= 1.0 + 1e-9


def test_an_effect_is_found_with_its_size_and_predicts_rows_kept_back():
    own = found(0.3)
    assert own.no_gap < 1e-6 and own.probability("slip-sinkage") > 0.9
    node = own.node_of(("slip-sinkage",))
    assert node.fit.values()["slip-sinkage.n1"] == pytest.approx(0.3, abs=0.05)
    out = own.terms.readings.run[own.terms.readings.row] == 3
    kept_back = [n.linear.log_density(n.at, out) for n in (own.soil, node)]
    assert kept_back[1] > kept_back[0] + 3.0


@pytest.mark.parametrize("n1", [0.0, 0.3])
def test_every_counted_hypothesis_is_an_optimum_under_its_own_hyperparameters(n1):
    """Descents from elsewhere, under the hyperparameters of a node, find nothing better."""
    own = found(n1)
    near = [n for n in own.nodes if n.value < own.best.value + 8.0]
    rng = np.random.default_rng(0)
    for node in near:
        starts = [
            {c.path: float(np.clip(x + 0.15 * rng.standard_normal(), c.lower, c.upper))
             for c, x in zip(node.fit.coordinates, node.fit.x, strict=True)}
            for _ in range(3)
        ]  # fmt: skip
        jobs = [StartedFit(node.hypothesis, start, node.at, node.outliers) for start in starts]
        for fit in map(own.search.fit, jobs):
            again = own.search.node(node.hypothesis, fit, node.at, node.outliers)
            assert again.value > node.value - 1.5


def test_a_reading_that_strays_weighs_nothing_and_is_told():
    own = found(strays=True)
    (stray,) = np.flatnonzero(own.outliers)
    assert own.terms.readings.row[stray] == 5
    assert own.terms.readings.channels[own.terms.readings.channel[stray]] == "torque"
    assert own.no_gap > 0.5


@pytest.mark.parametrize("n1", [0.0, 0.3])
def test_marginals_of_the_soil_contain_the_truth_and_do_not_depend_on_the_seed(n1):
    soil = case_of().soil
    one, other = (found(n1).soil_marginals(seed, 1.35) for seed in (0, 1))
    for path, marginal in one.items():
        low, high = marginal.interval()
        assert low < float(getattr(soil, path)) < high
        assert marginal.mean == pytest.approx(other[path].mean, abs=0.35 * marginal.std)
        assert marginal.std == pytest.approx(other[path].std, rel=0.4)


def test_draws_have_the_probabilities_of_their_hypotheses():
    own = found(0.3)
    draws = own.draws(0)
    assert sum(float(d.weight.sum()) for d in draws) == pytest.approx(1.0)
    for part in draws:
        low, high = (np.asarray([getattr(c, end) for c in part.node.fit.coordinates])
                     for end in ("lower", "upper"))  # fmt: skip
        assert ((part.x >= low) & (part.x <= high)).all()


def test_a_discrepancy_that_is_declared_is_no_gap():
    """A change of torque by a per cent is none where the model is known to be off by two."""
    case = case_of()
    table = driven(case, slips=6, seed=2)
    slip = table["slip"]
    table.columns["torque_Nm"] *= 1.0 + 0.05 * np.sin(6.0 * slip)
    plain = infer(problem(table))
    declared = infer(problem(table, MODEL + '[discrepancy]\ntorque_Nm = "3 %"\n'))
    assert plain.no_gap < 0.5 < declared.no_gap


def test_priors_are_opened_where_the_soil_presses_against_them():
    own = found(
        0.0, False, MODEL.replace("friction_angle = [0.3, 0.8]", "friction_angle = [0.3, 0.33]")
    )
    assert own.best.hypothesis.wide_priors and own.no_gap < 0.5


def test_prior_odds_are_of_families_first():
    one, two, other = (EFFECTS[n] for n in ("bulldozing", "torque-gain", "torque-offset"))
    penalties = effect_penalties({"bulldozing": one, "torque-gain": two})
    assert penalties["bulldozing"] == pytest.approx(2.0 * np.log(2.0))
    assert not exclude_each_other(two, other) and exclude_each_other(one, one)
    family = {n: e for n, e in EFFECTS.items() if e.about.family}
    shared = next(
        (a, b) for a in family for b in family
        if a < b and family[a].about.family == family[b].about.family
    )  # fmt: skip
    assert exclude_each_other(family[shared[0]], family[shared[1]])
    assert Hypothesis() == SOIL_ALONE
