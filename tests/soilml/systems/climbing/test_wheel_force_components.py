"""The forces of a rover's wheels on a slope."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.systems.climbing import SimulatedRover, Uncertainty
from soilml.systems.climbing.climb_balances import balance_std
from soilml.systems.climbing.wheel_force_components import (
    force_components,
    pull_of_rover,
)

EXACT = Uncertainty(speed=0.0, slope=0.0, entry_angle=0.0, front_load=0.0)


@pytest.fixture(scope="module")
def true():
    return SimulatedRover(noise=EXACT, stress=0.0)


@pytest.fixture(scope="module")
def climb(true):
    return true.simulate_climbs(np.random.default_rng(0), [0.14], 1)[0]


def test_the_forces_of_a_climb_balance_at_its_true_soil(true, climb):
    c, phi, k = true.shear
    wheels = (
        force_components(climb.front, true.rover, k),
        force_components(climb.rear, true.rover, k),
    )
    pull = pull_of_rover(true.rover, climb.slope, wheels, c, np.tan(phi))
    # what is left is the sampling of the rim
    assert pull == pytest.approx(true.rover.weight * np.sin(climb.slope), abs=0.6)


def test_the_std_of_the_balance_is_that_of_repeated_readings():
    """First-order spread against 200 readings of one climb."""
    noise = Uncertainty(speed=0.006, slope=0.004, entry_angle=0.0, front_load=0.08)
    true = SimulatedRover(noise=noise, stress=0.2)
    c, phi, k = true.shear
    unknown = replace(true.rover, front_share=None, height_ratio=None)
    off = []
    for climb in true.simulate_climbs(np.random.default_rng(3), [0.1], 200):
        wheels = (
            force_components(climb.front, true.rover, k),
            force_components(climb.rear, true.rover, k),
        )
        pull = pull_of_rover(unknown, climb.slope, wheels, c, np.tan(phi))
        off.append(pull - true.rover.weight * np.sin(climb.slope))
    claimed = balance_std(unknown, climb, true.shear, noise)[0]
    assert np.std(off) == pytest.approx(claimed, rel=0.2)
