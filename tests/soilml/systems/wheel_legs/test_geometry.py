"""Legs and feet as plates about the hub."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.systems.wheel_legs.geometry import FEET, Section, WheelLeg, wheel_leg


def of_first_leg(wheel):
    plates = wheel.plates()
    each = (plates.x.size - 1) // wheel.legs
    return plates.x[:each], plates.z[:each], plates.area[:each], plates.tilt[:each]


def test_table_3_has_the_printed_segments():
    counts = {name: of_first_leg(wheel_leg(name))[0].size for name in FEET}
    assert counts == {"none": 10, "LTF": 30, "SRF": 30, "CIF": 30}


def test_a_flat_foot_lies_level_across_the_end_of_the_leg():
    x, z, area, tilt = (part[10:] for part in of_first_leg(wheel_leg("SRF")))
    np.testing.assert_allclose(z, -0.18)
    np.testing.assert_allclose(np.sin(tilt), 0.0, atol=1e-12)
    assert x.min() == pytest.approx(-0.02375) and x.max() == pytest.approx(0.02375)
    assert area.sum() == pytest.approx(0.05 * 0.027)


def test_a_convex_tip_bulges_down_and_a_concave_one_up():
    assert of_first_leg(wheel_leg("LTF"))[1].min() == pytest.approx(-0.1855, abs=1e-4)
    _, z, _, _ = of_first_leg(wheel_leg("CIF"))
    assert z[10:23].max() == pytest.approx(-0.17, abs=1e-4)
    assert z[23:].min() == pytest.approx(-0.185, abs=2e-4)


def test_a_leg_bulges_to_the_rear():
    x, z, _, _ = of_first_leg(wheel_leg("none"))
    assert x.min() == pytest.approx(-0.03, abs=1e-3) and x.max() < 0
    assert z.min() > -0.18 and z.max() < 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"legs": 0}, "0 legs"),
        ({"legs": 7}, "1 to 6"),
        ({"legs": 2.5}, "2.5 legs"),
        ({"mass": 0.0}, "mass of 0 kg"),
        ({"mass": -1.0}, "must be positive"),
        ({"mass": np.nan}, "mass of nan"),
        ({"speed": -0.3}, "speed"),
        ({"leg": Section(10, 0.0, 0.18, 0.0)}, "section"),
        ({"clearance": -0.1}, "body"),
    ],
)
def test_an_invalid_wheel_leg_is_refused_in_one_line(change, message):
    with pytest.raises(InputError, match=message):
        wheel_leg("LTF", **change)
    assert replace(WheelLeg(), **change).invalid_reason


def test_an_unknown_foot_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"no foot 'boot'; there are: none, LTF, SRF, CIF"):
        wheel_leg("boot")
