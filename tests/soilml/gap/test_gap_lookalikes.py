"""Effects that runs cannot tell from another soil are said to be possible."""

from dataclasses import replace

import numpy as np
from gap_sets import case_of, driven, fit_problem

from soilml.gap.search.stepwise import search
from soilml.gap.verdict.lookalikes import like_another_force, like_another_soil
from soilml.physics.effects import EFFECTS

NAMES = ("curved-envelope", "slip-sinkage")


def searched(loads, names):
    """A problem of runs at these loads with these effects, and the search for them."""
    case = case_of()
    whole = fit_problem(case, driven(case, loads=loads))
    problem = replace(whole, effects={n: EFFECTS[n] for n in names})
    return problem, search(problem, problem.fit_soil([np.full(len(problem.soil), 0.5)]), 0)


def alike(loads):
    """What is said of two effects by runs at these loads."""
    found = like_another_soil(*searched(loads, NAMES))
    return {name: remark for remark in found for name in remark.about}


def test_a_curved_envelope_is_another_c_and_phi_at_one_load():
    found = alike((60.0, 60.0, 60.0))
    assert "slip-sinkage" not in found
    assert "curved-envelope" not in alike((40.0, 60.0, 90.0, 140.0))
    remark = found["curved-envelope"]
    assert remark.code == "like-another-soil"
    assert "cohesion" in remark.text or "friction angle" in remark.text


def test_an_effect_on_pull_alone_may_be_any_force_along_the_way():
    names = ("bulldozing", "slip-sinkage", "drawbar-gain")
    (remark,) = like_another_force(*searched((40.0, 90.0), names), names)
    assert remark.about == ("bulldozing",) and "cable" in remark.text
    problem, result = searched((40.0, 90.0), names)
    assert like_another_force(problem, result, ["slip-sinkage"]) == []
