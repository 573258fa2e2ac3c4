"""Pull against slip on ground not yet driven."""

import numpy as np
import pytest

from soilml.systems.climbing import (
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
    quantile_band,
)

pytestmark = pytest.mark.slow

SAND = {"cohesion": 0.0, "friction_angle": float(np.deg2rad(38.0))}


@pytest.fixture(scope="module")
def true():
    return SimulatedRover()


@pytest.fixture(scope="module")
def stresses(true):
    front, rear = true.simulate_artificial_slip(np.random.default_rng(2))
    return StressBySlip.fit(front), StressBySlip.fit(rear)


@pytest.fixture(scope="module")
def ground(true):
    climbs = true.simulate_climbs(np.random.default_rng(3), np.deg2rad([0.0, 4.0]).tolist())
    return identify_ground(true.rover, climbs, fixed=SAND)


@pytest.fixture(scope="module")
def ability(ground, stresses):
    return climbing_ability(ground, *stresses)


def test_stress_is_interpolated_between_measured_slips(true, stresses):
    arc, front = true.arcs[0], stresses[0]
    slips = np.asarray([0.1, 0.25, 0.5])
    for slip, profile in zip(slips, front.profiles(slips), strict=True):
        exact = arc.entry_angle(slip)
        assert profile.entry_angle == pytest.approx(exact, abs=0.02)
        assert profile.exit_angle == pytest.approx(exact - arc.width, abs=0.02)
        shape = arc.stress(slip, profile.angle)
        ratio = profile.normal / profile.normal.sum() - shape / shape.sum()
        assert np.abs(ratio).max() < 0.1 / len(shape)


def test_steep_slopes_are_predicted_from_gentle_ones(true, ability):
    slope = quantile_band(ability.slope)
    for driven in np.deg2rad([8.0, 10.0, 12.0]):
        at = true.slip_at(driven)
        low, high = (np.interp(at, ability.slip, v) for v in (slope.lower, slope.upper))
        assert low - 0.005 < driven < high + 0.005
    best = quantile_band(ability.steepest)
    assert best.lower - 0.005 < true.steepest < best.upper + 0.005
    assert best.upper - best.lower < 0.06
