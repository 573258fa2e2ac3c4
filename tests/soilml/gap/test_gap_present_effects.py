"""An effect that the model has already, at the wrong size, is corrected."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Case, ExitAngle, Model, Operating, SlipSinkage, Wheel, soil
from soilml.config.measurement_noise import Noise
from soilml.gap import gap
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.remarks import texts

pytestmark = pytest.mark.slow

WHEEL = Model(Wheel(radius=0.15, width=0.12))
SAND = soil("wong1989/dry_sand")
PRIOR = {
    "cohesion": Prior(0.0, 4000.0),
    "friction_angle": Prior(0.3, 0.8),
    "shear_modulus": Prior(0.003, 0.04),
}
NOISE = {
    "torque_Nm": Noise(share=0.02),
    "drawbar_pull_N": Noise(constant=0.2, share=0.02),
    "sinkage_m": Noise(share=0.02),
}


def measured(effect):
    """Eight runs of eight slips with an effect, and 2 % noise."""
    rng = np.random.default_rng(3)
    slip, load = np.tile(np.linspace(0.05, 0.6, 8), 8), np.repeat(np.linspace(40.0, 150.0, 8), 8)
    force = (WHEEL + effect)(SAND, Operating(slip=slip, load=load))
    columns = {"run": np.asarray([f"r{w:.0f}" for w in load]), "slip": slip, "load_N": load}
    for name, key in (
        ("torque", "torque_Nm"),
        ("drawbar_pull", "drawbar_pull_N"),
        ("sinkage", "sinkage_m"),
    ):
        true = getattr(force, name)
        columns[key] = true + NOISE[key].std(true) * rng.standard_normal(slip.size)
    return Table(columns)


@pytest.mark.parametrize(
    ("truth", "wrong", "size"),
    [
        (ExitAngle(kappa=0.15), ExitAngle(kappa=0.05), "kappa"),
        (SlipSinkage(n1=0.4), SlipSinkage(n1=0.2), "n1"),
    ],
)
def test_an_effect_of_the_wrong_size_is_named_and_corrected(truth, wrong, size):
    table = measured(truth)
    case = Case(WHEEL + wrong, SAND, PRIOR, NOISE)
    report = gap(case, table)
    assert report.cause_set == ((truth.name,),)
    assert any("at another size" in line for line in texts(report.lines))
    value = report.effects[0].parameters[size]
    assert abs(value.value - getattr(truth, size)) < 4.0 * value.std
    assert len(report.model.model.effects) == 1
    again = gap(report.model, table)
    assert again.status == "no-gap"


def test_added_effects_have_a_prior_with_their_uncertainty():
    report = gap(Case(WHEEL, SAND, PRIOR, NOISE), measured(SlipSinkage(n1=0.4)))
    prior = report.model.prior["slip-sinkage.n1"]
    assert prior.lower < 0.4 < prior.upper and prior.upper - prior.lower < 0.2


def test_fixed_parameters_are_reported():
    report = gap(Case(WHEEL, SAND, PRIOR, NOISE), measured(SlipSinkage(n1=0.4)))
    (fixed,) = [one for one in report.not_claimed if one.code == "fixed-parameters"]
    assert fixed.about[:6] == ("kphi", "kc", "n", "a0", "a1", "gear.radius")
    freed = {"kphi": Prior(1e5, 1e7, log=True), "n": Prior(0.5, 1.5)}
    more = gap(replace(Case(WHEEL, SAND, PRIOR | freed, NOISE)), measured(SlipSinkage(n1=0.4)))
    (fixed,) = [one for one in more.not_claimed if one.code == "fixed-parameters"]
    assert not {"kphi", "kc", "n"} & set(fixed.about)
