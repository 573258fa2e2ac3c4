"""Prior odds of effects: shared by families, then within them; whatever the catalogue's size."""

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.gap.evidence.prior_odds import EXPECTED_CAUSES, effect_penalties
from soilml.physics.effects import EFFECTS

SHARED = ("elliptic-pressure", "parabolic-pressure")
ALONE = ("slip-sinkage", "bulldozing")


def odds(effects):
    return {n: np.exp(-0.5 * p) for n, p in effect_penalties(effects).items()}


def test_a_family_has_the_odds_of_one_effect():
    found = odds({n: EFFECTS[n] for n in (*SHARED, *ALONE)})
    assert [found[n] for n in ALONE] == pytest.approx([EXPECTED_CAUSES / 3.0] * 2)
    assert [found[n] for n in SHARED] == pytest.approx([EXPECTED_CAUSES / 6.0] * 2)


def test_a_larger_catalogue_makes_no_cause_likelier():
    assert sum(odds(EFFECTS).values()) == pytest.approx(EXPECTED_CAUSES)
    assert sum(odds({"slope": EFFECTS["slope"]}).values()) == pytest.approx(EXPECTED_CAUSES)


def test_an_effect_on_one_of_several_gears_is_of_its_own_family():
    grousers = EFFECTS["grousers"]
    named = ("grousers", "grousers@lugged", "grousers@smooth")
    found = odds(dict.fromkeys(named, grousers) | {"slope": EFFECTS["slope"]})
    assert found["grousers@smooth"] == pytest.approx(found["slope"] / 3.0)


def test_a_set_has_the_product_of_the_odds_of_its_effects():
    problem = fit_problem(case_of(), driven(case_of()))
    each = effect_penalties(problem.effects)
    assert problem.penalty(()) == 0.0
    assert problem.penalty(ALONE) == pytest.approx(sum(each[n] for n in ALONE))
