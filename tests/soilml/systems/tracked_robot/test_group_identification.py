"""Soil from the pull of a track, group by group."""

import numpy as np
import pytest

from soilml import Case, Model, simulate, soil
from soilml.config.measurement_noise import Noise
from soilml.numerics.prior import Prior
from soilml.systems.tracked_robot.group_identification import identify_groups
from soilml.systems.tracked_robot.robot import WANG2018

pytestmark = pytest.mark.slow

PRIOR = {
    "n": Prior(0.5, 1.5),
    "friction_angle": Prior(np.deg2rad(20.0), np.deg2rad(40.0)),
    "kphi": Prior(5e5, 3e6, log=True),
    "shear_modulus": Prior(0.01, 0.08),
    "cohesion": Prior(900.0, 1200.0),
}
CASE = Case(
    Model(WANG2018.track),
    soil("wang2018/sand"),
    PRIOR,
    {"drawbar_pull_N": Noise(constant=5.0, share=0.03)},
)
SHEAR = ("friction_angle", "shear_modulus", "cohesion")


@pytest.fixture(scope="module")
def groups():
    slips = np.linspace(0.05, 0.85, 8)
    tables = [simulate(CASE, slips, WANG2018.load, seed=k) for k in range(4)]
    return identify_groups(CASE, tables, SHEAR)


def test_pull_at_one_load_identifies_friction_and_modulus_but_not_cohesion(groups):
    assert groups.names == SHEAR
    assert groups.remaining_fraction["cohesion"] > 0.5
    assert (
        groups.remaining_fraction["friction_angle"] < 0.5
        and groups.remaining_fraction["shear_modulus"] < 0.5
    )
    cohesion = groups.names.index("cohesion")
    assert groups.pooled.remaining_fraction["cohesion"] > 0.9
    # the average of what is not told is as wide as the prior
    assert groups.std[cohesion] > 0.7 * PRIOR["cohesion"].std


def test_the_truth_lies_within_the_reported_uncertainty(groups):
    truth = np.asarray([getattr(CASE.soil, name) for name in groups.names])
    assert (np.abs(groups.mean - truth) < 3.0 * groups.std).all()
    assert (np.abs(groups.pooled.values - truth) < 3.0 * groups.pooled.std).all()
