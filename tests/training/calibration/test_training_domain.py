"""The training domain contains genuine rows, and no torques beyond any soil of the prior."""

import numpy as np
import pytest

from soilml import Model, Operating, Wheel, soil
from training.calibration.training_domain import TrainingDomain
from training.dataset import read_dataset

FEATURES = ("slip", "torque/load", "load")
TARGETS = ("cohesion", "friction_angle", "shear_modulus")


@pytest.fixture(scope="module")
def halves(small_data):
    data = read_dataset(small_data, FEATURES, TARGETS)
    first = np.random.default_rng(0).random(len(data)) < 0.5
    return data.rows(first), data.rows(~first)


def corners(slip, load):
    """Torque that the softest and the firmest soil of the prior give."""
    c, phi, k = np.meshgrid([0.0, 3000.0], [0.436332, 0.785398], [0.005, 0.03], indexing="ij")
    sand = soil(
        "wong1989/dry_sand",
        cohesion=c.reshape(-1, 1),
        friction_angle=phi.reshape(-1, 1),
        shear_modulus=k.reshape(-1, 1),
    )
    torque = Model(Wheel(radius=0.15, width=0.12))(sand, Operating(slip=slip, load=load)).torque
    return torque.min(axis=0), torque.max(axis=0)


def test_rows_of_training_are_in_range_and_hardly_any_genuine_row_is_not(halves):
    first, second = halves
    domain = TrainingDomain.of(first.features, FEATURES)
    assert domain.contains(first.features).all()
    assert domain.contains(second.features).mean() > 0.99


def test_torques_far_beyond_any_soil_are_out_of_range_everywhere(halves):
    """Thirty standard deviations of the noise, 2 %, beyond the ends of the prior."""
    domain = TrainingDomain.of(halves[0].features, FEATURES)
    slip, load = (x.ravel() for x in np.meshgrid(np.linspace(0.06, 0.59, 20), [32, 60, 90, 118]))
    least, most = corners(slip, load)
    for torque, share in ((least / 1.6, 0.97), (least / 2.0, 1.0), (most * 1.6, 1.0)):
        out = ~domain.contains(np.stack([slip, torque / load, load], axis=1))
        assert out.mean() >= share
    within = np.stack([slip, np.sqrt(least * most) / load, load], axis=1)
    assert domain.contains(within).all()
