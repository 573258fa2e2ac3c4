"""An effect that the model has already, at the wrong size, is corrected."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml import ExitAngle, SlipSinkage
from soilml.gap import gap
from soilml.numerics.prior import Prior
from soilml.remarks import texts

pytestmark = pytest.mark.slow

LOADS = np.linspace(40.0, 150.0, 8)


def measured(effect):
    """Eight runs of eight slips with an effect."""
    return driven(case_of(), [effect], loads=LOADS, seed=3)


@pytest.mark.parametrize(
    ("truth", "wrong", "size"),
    [
        (ExitAngle(kappa=0.15), ExitAngle(kappa=0.05), "kappa"),
        (SlipSinkage(n1=0.4), SlipSinkage(n1=0.2), "n1"),
    ],
)
def test_an_effect_of_the_wrong_size_is_named_and_corrected(truth, wrong, size):
    table = measured(truth)
    case = case_of()
    report = gap(replace(case, model=case.model + wrong), table)
    assert report.cause_set == ((truth.name,),)
    assert any("at another size" in line for line in texts(report.lines))
    value = report.effects[0].parameters[size]
    assert abs(value.value - getattr(truth, size)) < 4.0 * value.std
    assert len(report.model.model.effects) == 1
    again = gap(report.model, table)
    assert again.status == "no-gap"


def test_added_effects_have_a_prior_and_fixed_parameters_are_reported():
    report = gap(case_of(), measured(SlipSinkage(n1=0.4)))
    prior = report.model.prior["slip-sinkage.n1"]
    assert prior.lower < 0.4 < prior.upper and prior.upper - prior.lower < 0.2
    (fixed,) = [one for one in report.not_claimed if one.code == "fixed-parameters"]
    assert fixed.about[:6] == ("kphi", "kc", "n", "a0", "a1", "gear.radius")
    freed = {"kphi": Prior(1e5, 1e7, log=True), "n": Prior(0.5, 1.5)}
    case = replace(case_of(), prior=case_of().prior | freed)
    more = gap(case, measured(SlipSinkage(n1=0.4)))
    (fixed,) = [one for one in more.not_claimed if one.code == "fixed-parameters"]
    assert not {"kphi", "kc", "n"} & set(fixed.about)
