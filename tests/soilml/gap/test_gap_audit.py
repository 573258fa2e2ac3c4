"""What a design can identify: figures by hand, and the audit of a small design."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.errors import InputError
from soilml.gap import audit
from soilml.gap.identifiability import identifiability
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
    assert (dug.rival, dug.cosine) == ("grousers", pytest.approx(0.8))
    assert dug.separating_snr == pytest.approx(3.0 * 0.6)
    size = EFFECTS["slip-sinkage"].about.reference["n1"]
    assert (dug.size, dug.unit, dug.kind) == (size, "1", EFFECTS["slip-sinkage"].about.kind)
    assert dug.detectable_size == pytest.approx((3.0 + 0.8416) / 3.0 * size)
    assert lugs.separating_snr == pytest.approx(5.0 * 0.6) and lugs.absorbed == pytest.approx(0.0)
    assert ploughed.separating_snr == pytest.approx(12.0)
    assert left.detectable_size == float("inf") and left.signal == pytest.approx(3.0)
    assert identifiability({}, SOIL, EFFECTS) == []


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
