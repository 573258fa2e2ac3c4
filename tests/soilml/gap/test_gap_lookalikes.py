"""Effects that runs cannot tell from another soil are said to be possible."""

from dataclasses import replace

import numpy as np
from gap_sets import case_of, driven, fit_problem

from soilml.gap.search.stepwise import search
from soilml.gap.verdict.lookalikes import like_another_soil
from soilml.physics.effects import EFFECTS

NAMES = ("curved-envelope", "slip-sinkage")


def alike(loads):
    """What is said of two effects by runs at these loads."""
    case = case_of()
    whole = fit_problem(case, driven(case, loads=loads))
    problem = replace(whole, effects={n: EFFECTS[n] for n in NAMES})
    soil = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    found = like_another_soil(problem, search(problem, soil, 0))
    return {name: remark for remark in found for name in remark.about}


def test_a_curved_envelope_is_another_c_and_phi_at_one_load():
    found = alike((60.0, 60.0, 60.0))
    assert "slip-sinkage" not in found
    assert "curved-envelope" not in alike((40.0, 60.0, 90.0, 140.0))
    remark = found["curved-envelope"]
    assert remark.code == "like-another-soil"
    assert "cohesion" in remark.text or "friction angle" in remark.text
