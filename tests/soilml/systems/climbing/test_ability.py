"""Pull against slip on ground not yet driven."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilml.errors import FitError, InputError
from soilml.systems.climbing import (
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
    quantile_band,
)
from soilml.systems.climbing.climb import WheelRun
from soilml.systems.force_sensor_wheel import StressProfile

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


def test_stress_moves_forward_with_slip(stresses):
    profiles = stresses[0].profiles(np.linspace(0.05, 0.65, 5))
    assert np.all(np.diff([p.entry_angle for p in profiles]) > 0.0)


def test_slips_without_measured_stress_are_refused(stresses):
    for slip in (0.01, 0.8):
        with pytest.raises(FitError, match="stress was measured from"):
            stresses[0].profiles(np.asarray([slip]))


def test_stress_at_one_slip_is_refused(true):
    front, _ = true.simulate_artificial_slip(np.random.default_rng(0), [0.2], 3)
    with pytest.raises(FitError, match="two slips"):
        StressBySlip.fit(front)


def test_resampled_stress_scatters_as_the_readings(true, stresses):
    rng = np.random.default_rng(0)
    at = np.asarray([0.36])
    entries = [stresses[0].resampled(rng).profiles(at)[0].entry_angle for _ in range(60)]
    assert 1e-4 < np.std(entries) < 0.01


def test_steep_slopes_are_predicted_from_gentle_ones(true, ability):
    slope = quantile_band(ability.slope)
    for driven in np.deg2rad([8.0, 10.0, 12.0]):
        at = true.slip_at(driven)
        low, high = (np.interp(at, ability.slip, v) for v in (slope.lower, slope.upper))
        assert low - 0.005 < driven < high + 0.005
    best = quantile_band(ability.steepest)
    assert best.lower - 0.005 < true.steepest < best.upper + 0.005
    assert best.upper - best.lower < 0.06


def test_the_steepest_slope_is_the_largest_of_the_curve(ability):
    assert np.all(ability.steepest >= ability.slope.max(axis=1))
    assert np.all(ability.steepest_within(0.3) <= ability.steepest)
    assert np.all(ability.steepest_within(0.2) < ability.steepest_within(0.4))


def test_a_slip_limit_beyond_the_stresses_is_refused(ability):
    with pytest.raises(InputError, match="there is no prediction outside"):
        ability.steepest_within(0.95)


def test_slips_of_front_and_rear_must_overlap(true, ground):
    rng = np.random.default_rng(1)
    front, _ = true.simulate_artificial_slip(rng, [0.04, 0.13], 2)
    _, rear = true.simulate_artificial_slip(rng, [0.36, 0.68], 2)
    with pytest.raises(FitError, match="ranges must overlap"):
        climbing_ability(ground, StressBySlip.fit(front), StressBySlip.fit(rear))


def test_a_larger_speed_error_widens_the_interval(true):
    climbs = true.simulate_climbs(np.random.default_rng(3), [0.0, 0.07], 2)
    narrow = identify_ground(true.rover, climbs, fixed=SAND, noise=true.noise)
    poor = replace(true.noise, speed_scale=0.02)
    wide = identify_ground(true.rover, climbs, fixed=SAND, noise=poor)
    assert wide.fit.std[0] > 1.5 * narrow.fit.std[0]


def test_a_profile_keeps_its_shape_whatever_its_height():
    angle = np.linspace(-0.2, 0.4, 61)
    stress = np.maximum(0.0, 1.0 - ((angle - 0.1) / 0.25) ** 2)
    low, high = (
        StressBySlip.fit([WheelRun(s, StressProfile(angle, m * stress)) for s in (0.1, 0.3, 0.5)])
        for m in (1e3, 3e4)
    )
    at = np.asarray([0.2])
    np.testing.assert_allclose(low.profiles(at)[0].normal, high.profiles(at)[0].normal, atol=1e-9)


def test_the_example_on_the_page_runs():
    page = (Path(__file__).parents[4] / "docs/papers/nagatani_climbing.md").read_text()
    names: dict = {}
    exec(re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0], names)
    best = quantile_band(names["ability"].steepest)
    assert best.lower < names["true"].steepest < best.upper
