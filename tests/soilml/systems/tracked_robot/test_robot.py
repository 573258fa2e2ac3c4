"""The robot on two tracks: plateaus, balance, tension."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Model, Operating, soil
from soilml.systems.tracked_robot.robot import WANG2018, track_balance

SAND, CLAY = soil("wang2018/sand"), soil("wang2018/clay")


def test_the_parts_of_a_track_carry_the_load_together():
    at = Operating(slip=np.asarray([0.1, 0.5]), load=WANG2018.load)
    found = track_balance(Model(WANG2018.track), SAND, at)
    front, belt, rear = (found[f"{part}_share"] for part in ("front", "belt", "rear"))
    np.testing.assert_allclose(front + belt + rear, 1.0, rtol=1e-12)
    assert (belt > front).all() and (front > rear).all()
    sunk = Model(WANG2018.track)(SAND, at).sinkage
    np.testing.assert_allclose(np.sin(found["trim_rad"]), 0.2 * sunk / 0.6)


def test_the_tension_of_an_even_pressure_is_that_of_a_ring():
    """A taut belt lies nearly flat: the pressure is even, and so the tension b R_t sigma."""
    track = replace(WANG2018.track, leaving=0.001, rebound=1.0, settling=0.0)
    at = Operating(slip=0.2, load=WANG2018.load)
    found, sunk = track_balance(Model(track), CLAY, at), Model(track)(CLAY, at).sinkage
    radius = track.contact_geometry(sunk, CLAY, at).arc_radius
    expected = 0.08 * radius * CLAY.kphi * sunk**CLAY.n
    assert found["belt_tension_N"] == pytest.approx(float(expected), rel=0.01)
