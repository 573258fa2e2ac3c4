"""The forces of a rover's wheels on a slope."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.systems.climbing import SimulatedRover, Uncertainty
from soilml.systems.climbing.climb_balances import balance_std
from soilml.systems.climbing.wheel_force_components import (
    estimate_wheel_loads,
    force_components,
    pull_of_rover,
)
from soilml.systems.force_sensor_wheel import forces_from_profile

EXACT = Uncertainty(speed=0.0, slope=0.0, entry_angle=0.0, front_load=0.0)


@pytest.fixture(scope="module")
def true():
    return SimulatedRover(noise=EXACT, stress=0.0)


@pytest.fixture(scope="module")
def climb(true):
    return true.simulate_climbs(np.random.default_rng(0), [0.14], 1)[0]


def test_forces_are_linear_in_magnification_and_cohesion(true, climb):
    wheel = force_components(climb.front, true.rover, 0.007)
    whole = forces_from_profile(
        climb.front.profile,
        magnification=1.7,
        cohesion=300.0,
        friction_angle=0.6,
        shear_modulus=0.007,
        slip=climb.front.slip,
        radius=0.055,
        width=0.064,
    )
    assert wheel.pull(1.7, 300.0, np.tan(0.6)) == pytest.approx(whole.drawbar_pull, rel=1e-12)
    assert wheel.load(1.7, 300.0, np.tan(0.6)) == pytest.approx(whole.load, rel=1e-12)


def test_the_forces_of_a_climb_balance_at_its_true_soil(true, climb):
    c, phi, k = true.shear
    wheels = (
        force_components(climb.front, true.rover, k),
        force_components(climb.rear, true.rover, k),
    )
    pull = pull_of_rover(true.rover, climb.slope, wheels, c, np.tan(phi))
    # what is left is the sampling of the rim
    assert pull == pytest.approx(true.rover.weight * np.sin(climb.slope), abs=0.6)


def test_wheel_loads_are_estimated_from_climbs(true):
    climbs = true.simulate_climbs(np.random.default_rng(1), [0.0, 0.07, 0.14, 0.2], 1)
    unknown = replace(true.rover, front_share=None, height_ratio=None)
    found = estimate_wheel_loads(unknown, climbs, true.shear)
    assert found.front_share == pytest.approx(0.52, abs=0.005)
    assert found.height_ratio == pytest.approx(0.4, abs=0.03)


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
