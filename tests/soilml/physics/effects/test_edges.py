"""Effects and gears at the edges of their cases: zero slip, a maximum at the entry, both exits."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, Midstance, Model, Operating, Status, Track, Wheel, soil
from soilml.physics.load_case import LoadCase

SAND = soil("wong1989/dry_sand")
WHEEL = Wheel(radius=0.15, width=0.12)
FOOT = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)


def true_slip(slip, error):
    at = Operating(slip=np.asarray(slip, float), load=np.full(np.shape(slip), 60.0))
    effect = EFFECTS["slip-scale"](error=error)
    return effect.on_operating(at, LoadCase(WHEEL, SAND, at)).slip


@pytest.mark.parametrize("error", [-0.15, -0.01, 0.0, 0.02, 0.15])
def test_a_wheel_speed_off_by_a_factor_is_a_slip_that_follows_from_the_travel_ratio(error):
    slip = np.asarray([-0.9, -0.05, -0.01, 0.0, 0.01, 0.05, 0.4, 0.9])
    # v / (r omega) as reported, and with the true rim speed
    reported = np.where(slip < 0, 1.0 / (1.0 + slip), 1.0 - slip)
    true = reported / (1.0 + error)
    expected = np.where(true <= 1.0, 1.0 - true, 1.0 / true - 1.0)
    np.testing.assert_allclose(true_slip(slip, error), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("gear", [WHEEL, FOOT])
@pytest.mark.parametrize(("a0", "a1"), [(1.0, 0.0), (0.0, 0.0), (0.9, 0.6)])
def test_a_maximum_at_an_end_of_the_contact_or_beyond_is_no_peak(gear, a0, a1):
    ground = replace(SAND, a0=a0, a1=a1)
    force = Model(gear)(ground, Operating(slip=0.25, load=2.0))
    assert force.status == Status.NO_PEAK and np.isnan(force.torque)


@pytest.mark.parametrize("load", [1e2, 1e7])
def test_a_track_under_an_enormous_load_is_first_guessed_on_its_front_wheel(load):
    track = Track(radius=0.1, width=0.08, base=0.6)
    at = Operating(slip=np.zeros(1), load=np.asarray([load]))
    k = SAND.kc + 0.08 * SAND.kphi
    flat = (load / (k * 0.6)) ** (1.0 / SAND.n)
    front = (1.5 * load / ((3.0 - SAND.n) * k * np.sqrt(0.2))) ** (2.0 / (2.0 * SAND.n + 1.0))
    assert (front < flat) == (load > 1e6)
    assert track.initial_sinkage(SAND, at) == pytest.approx(min(flat, front), rel=1e-12)
