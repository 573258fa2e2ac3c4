"""The page on wheel-legs and slip, and the gap that its authors found."""

import numpy as np
import pytest

from soilml import Model, Operating, soil
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.identification import identify
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.fusion_rules import pairwise
from soilml.papers.comin2017_slip import FOOT
from soilml.systems.wheel_legs.resistive_force import GROUNDS, wheel_leg
from soilml.systems.wheel_legs.walk import walk

SAND = soil("comin2017/ssc-2", shear_modulus=0.017 * FOOT.area**0.5)
CASE = Case(
    Model(FOOT), SAND,
    prior={
        "friction_angle": Prior(0.35, 0.9), "shear_modulus": Prior(1e-4, 2e-2, log=True),
        "kphi": Prior(1e5, 2.5e6, log=True),
    },
    noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(constant=5e-4)},
)  # fmt: skip
LOADS, SLIPS = np.repeat([8.0, 11.0, 14.0], 4), np.tile([0.05, 0.2, 0.35, 0.5], 3)


def misfit(torque, sinkage):
    """Mean squared residual over the noise of the best soil under the midstance integrals."""
    columns = {"slip": SLIPS, "load_N": LOADS, "torque_Nm": torque, "sinkage_m": sinkage}
    return identify(CASE, Table(columns), method="nonlinear").misfit


@pytest.mark.slow
def test_no_soil_makes_midstance_integrals_follow_a_walk_by_resistive_forces():
    legs = [wheel_leg("LTF", mass=load / 9.81) for load in LOADS]
    walked = walk(legs, GROUNDS["SSC-2"], slip=SLIPS, turns=1.0, steps=500).after(0.4 * np.pi)
    sinkage = walked.at_midstance(walked.sinkage) + FOOT.tip_height
    assert misfit(walked.at_midstance(walked.torque), sinkage) > 4.0
    own = Model(FOOT)(SAND, Operating(slip=SLIPS, load=LOADS))
    assert misfit(own.torque, own.sinkage) < 0.01


def test_the_middle_line_of_the_fusion_rule_as_printed_does_not_sum_to_one():
    T, V, S = 0.3, 0.2, 0.1
    printed = (V / (V + T) + S / (S + T), V / (V + T) + S / (V + S), T / (S + T) + V / (V + S))
    assert abs(sum(printed) / 3 - 1) > 0.05
    weights = pairwise(np.zeros(3), np.sqrt([T, V, S])).weights
    np.testing.assert_allclose(3 * weights[1], T / (V + T) + S / (V + S))
