"""What a design can identify: figures by hand, and the audit of a small design."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.errors import InputError
from soilml.gap import audit
from soilml.gap.identifiability import (
    identifiability,
    indistinguishable_classes,
)
from soilml.physics.effects import EFFECTS

#: The soil can change the first reading alone.
SOIL = np.asarray([[1.0], [0.0], [0.0], [0.0], [0.0]])


#: Changes of whitened readings.
SIGNATURES = {
    "slip-sinkage": np.asarray([4.0, 3.0, 0.0, 0.0, 0.0]),  # of which 3 is left
    "grousers": np.asarray([0.0, 4.0, 3.0, 0.0, 0.0]),  # 5, at a cosine of 0.8 to the first
    "bulldozing": np.asarray([0.0, 0.0, 0.0, 12.0, 0.0]),
    "exit-angle": np.asarray([3.0, 0.0, 0.0, 0.0, 0.0]),  # what the soil does as well
}


def test_figures_of_a_design_by_hand():
    dug, lugs, ploughed, left = identifiability(SIGNATURES, SOIL, EFFECTS)
    assert (dug.signal, dug.residual_signal) == (pytest.approx(5.0), pytest.approx(3.0))
    assert dug.absorbed == pytest.approx(1.0 - 9.0 / 25.0)
    assert dug.rivals[0] == ("grousers", pytest.approx(0.8))
    assert dug.separating_snr == pytest.approx(3.0 * 0.6)
    size = EFFECTS["slip-sinkage"].about.reference["n1"]
    assert (dug.size, dug.unit, dug.kind) == (size, "1", EFFECTS["slip-sinkage"].about.kind)
    assert dug.detectable_size == pytest.approx((3.0 + 0.8416) / 3.0 * size)
    assert lugs.separating_snr == pytest.approx(5.0 * 0.6) and lugs.absorbed == pytest.approx(0.0)
    assert ploughed.separating_snr == pytest.approx(12.0)
    assert left.detectable_size == float("inf") and left.signal == pytest.approx(3.0)
    assert identifiability({}, SOIL, EFFECTS) == []


@pytest.mark.parametrize("factor, alike", [(1.0, True), (1.2, False)])
def test_effects_are_alike_where_two_sigma_tell_them_apart(factor, alike):
    """The weaker of the first two leaves 1.8 sigma, and 2.2 where it is 1.2 times as large."""
    stronger = SIGNATURES | {"slip-sinkage": factor * SIGNATURES["slip-sinkage"]}
    found = indistinguishable_classes(stronger, SOIL)
    assert found == ((("slip-sinkage", "grousers"),) if alike else ())
    assert indistinguishable_classes({}, SOIL) == ()


def test_classes_are_joined_by_a_common_member():
    chain = {
        "rate": [0.0, 4.0, 1.0, 0.0, 0.0],
        "slope": [0.0, 4.0, -1.0, 0.0, 0.0],
        "multipass": [0.0, 4.0, 0.0, 0.0, 0.0],
        "bulldozing": [0.0, 0.0, 0.0, 1.5, 0.0],  # below two sigma: in no class
        "exit-angle": [0.0, 0.0, 0.0, 1.4, 0.0],
    }
    chain = {name: np.asarray(column) for name, column in chain.items()}
    assert indistinguishable_classes(chain, SOIL) == (("rate", "slope", "multipass"),)


def test_an_audit_needs_noise():
    case = case_of()
    silent = case_of().__class__(**{**case.__dict__, "noise": {}})
    with pytest.raises(InputError, match="noise"):
        audit(silent, driven(case, loads=(40.0,), slips=3, noise=0.0))


@pytest.mark.slow
def test_the_unknown_parameters_are_those_with_a_prior_else_those_of_shear():
    case, none = case_of(), replace(case_of(), prior={})
    design, few = driven(case), {name: EFFECTS[name] for name in ("torque-gain", "bulldozing")}

    def found(case, free=None):
        return audit(case, design, free=free, effects=few).as_json()["effects"]

    one = replace(case, prior={"cohesion": case.prior["cohesion"]})
    assert found(one) == found(case, ["cohesion"]) != found(case)
    assert found(none) != found(one)
