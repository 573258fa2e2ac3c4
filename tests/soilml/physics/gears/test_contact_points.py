"""Points of contacts, profiles and first guesses of the sinkage, by their formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilml import Midstance, Operating, Track, soil

SAND = soil("wong1989/dry_sand", kc=2e4, n=1.1)
FOOT = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
TRACK = Track(radius=0.1, width=0.08, base=0.6)


@pytest.mark.parametrize("sinkage", [0.002, 0.02, 0.1])  # low, medium and high
def test_a_profile_of_a_foot_runs_evenly_from_its_top_to_below_the_hub(sinkage):
    at = Operating(slip=np.asarray([0.3]), load=np.asarray([20.0]))
    sole = FOOT.contact_geometry(np.asarray([sinkage]), SAND, at)
    entry = math.acos(1.0 - sinkage / FOOT.radius)
    peak = (SAND.a0 + 0.3 * SAND.a1) * entry
    assert sole.peak == pytest.approx(peak)
    assert sole.hub_offset == pytest.approx(0.18 + 0.0055 - FOOT.radius)
    angle, contact = FOOT.profile_contact(sole, at, 41)
    np.testing.assert_allclose(
        angle[:, 0], np.linspace(min(entry, FOOT.arc), 0.0, 41), rtol=1e-7, atol=1e-12
    )
    # behind the maximum, the pressure is that of the angle before it at the same fraction
    before = np.where(angle < peak, entry - angle / peak * (entry - peak), angle)
    depth = FOOT.radius * (np.cos(before) - math.cos(entry))
    np.testing.assert_allclose(contact.depth, np.maximum(depth, 0.0), rtol=1e-6, atol=1e-12)
    moved = FOOT.radius * (entry - angle - 0.7 * (math.sin(entry) - np.sin(angle)))
    np.testing.assert_allclose(contact.shear_displacement, moved, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(contact.surface_travel, FOOT.radius * (entry - angle), atol=1e-12)
    assert not contact.area.any() and not contact.frontal_area.any()


@pytest.mark.parametrize("slip", [-0.4, 0.0, 0.6])
@pytest.mark.parametrize(
    "shape",
    [{}, {"leaving": 0.3, "rebound": 0.2}, {"settling": 0.5, "rear_leaving": 0.3}],
    ids=["usual", "slack", "tail down"],
)
def test_a_profile_of_a_belt_is_that_of_the_points_of_its_contact(slip, shape):
    track = replace(TRACK, **shape)
    at = Operating(slip=np.full(2, slip), load=np.full(2, 600.0))
    belt = track.contact_geometry(np.asarray([0.01, 0.05]), SAND, at)
    assert not track.geometry_status(belt).any()
    contact = track.contact(belt, at)
    angle, profile = track.profile_contact(belt, at, 200_001)
    for row in range(2):
        along = profile.surface_travel[:, row]
        assert along[0] == 0.0 and (np.diff(along, 2) < 1e-12).all()
        used = contact.area[:, row] > 0.0
        place = contact.surface_travel[used, row]
        for name in ("depth", "shear_displacement"):
            values = getattr(profile, name)[:, row]
            points = np.interp(place, along, values)
            near = 2e-3 * np.abs(values).max()
            np.testing.assert_allclose(
                getattr(contact, name)[used, row], points, atol=near, err_msg=name
            )
        tangent = contact.frontal_area[used, row] / contact.area[used, row]
        np.testing.assert_allclose(
            tangent, np.sin(np.interp(place, along, angle[:, row])), atol=1e-3
        )
        assert angle[0, row] == pytest.approx(belt.entry[row])
        assert angle[-1, row] == pytest.approx(-belt.exit[row])
        length = contact.area[:, row].sum() / track.width
        assert length <= along[-1] * (1.0 + 1e-9)
    assert profile.shear_lever_arm == contact.shear_lever_arm == track.radius
    assert not profile.area.any() and not profile.horizontal_area.any()
