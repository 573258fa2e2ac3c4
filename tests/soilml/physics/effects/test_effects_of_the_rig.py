"""Each effect of rig and sensors against what it says of them."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, Model, Operating, Wheel, soil

SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))
AT = Operating(slip=np.asarray([-0.4, -0.1, 0.15, 0.4, 0.7]), load=60.0)
PLAIN = WHEEL(SAND, AT)
CHANNELS = ("torque", "drawbar_pull", "sinkage")


def test_weight_pulls_back_on_a_slope_and_forward_in_reverse():
    model = WHEEL + EFFECTS["slope"](angle=0.2)
    flat = WHEEL(SAND, replace(AT, load=60.0 * np.cos(0.2)))
    up, down = (model(SAND, replace(AT, speed=v)) for v in (0.1, -0.1))
    np.testing.assert_allclose(up.drawbar_pull, flat.drawbar_pull - 60.0 * np.sin(0.2))
    np.testing.assert_allclose(0.5 * (up.drawbar_pull + down.drawbar_pull), flat.drawbar_pull)
    np.testing.assert_array_equal(model(SAND, AT).drawbar_pull, up.drawbar_pull)
    np.testing.assert_allclose(up.torque, flat.torque)


def test_the_soil_carries_what_the_pull_presses_down():
    found = (WHEEL + EFFECTS["load-transfer"](ratio=0.2, offset=3.0))(SAND, AT)
    true = WHEEL(SAND, replace(AT, load=63.0 + 0.2 * found.drawbar_pull))
    for channel in CHANNELS:
        np.testing.assert_allclose(getattr(found, channel), getattr(true, channel), rtol=1e-7)


def test_a_load_that_is_lifted_away_barely_touches():
    found = (WHEEL + EFFECTS["load-transfer"](offset=-100.0))(SAND, AT)
    assert (found.status == 0).all() and (found.sinkage < 1e-5).all()


def test_a_bearing_rubs_under_the_load_that_it_carries():
    found = (WHEEL + EFFECTS["bearing-friction"](coefficient=0.02))(SAND, AT)
    np.testing.assert_allclose(found.torque - PLAIN.torque, 0.02 * 60.0 * 0.15)
    weighed = WHEEL + EFFECTS["load-gain"](gain=0.25) + EFFECTS["bearing-friction"](coefficient=0.1)
    np.testing.assert_allclose(
        weighed(SAND, AT).torque - WHEEL(SAND, replace(AT, load=48.0)).torque, 0.1 * 48.0 * 0.15
    )


def test_a_load_cell_that_reads_a_quarter_too_much():
    found = (WHEEL + EFFECTS["load-gain"](gain=0.25))(SAND, AT)
    for channel in CHANNELS:
        expected = getattr(WHEEL(SAND, replace(AT, load=48.0)), channel)
        np.testing.assert_allclose(getattr(found, channel), expected, rtol=1e-9)


@pytest.mark.parametrize(
    "name, size, channel, times, more",
    [
        ("torque-offset", 0.3, "torque", 1.0, 0.3),
        ("torque-gain", -0.1, "torque", 0.9, 0.0),
        ("drawbar-offset", -2.0, "drawbar_pull", 1.0, -2.0),
        ("drawbar-gain", 0.1, "drawbar_pull", 1.1, 0.0),
        ("sinkage-offset", -0.05, "sinkage", 1.0, -0.05),
        ("sinkage-gain", 0.2, "sinkage", 1.2, 0.0),
    ],
)
def test_a_sensor_changes_its_own_channel_alone(name, size, channel, times, more):
    found = (WHEEL + EFFECTS[name](**{EFFECTS[name].about.size: size}))(SAND, AT)
    for other in CHANNELS:
        exact = getattr(PLAIN, other)
        expected = times * exact + more if other == channel else exact
        np.testing.assert_allclose(getattr(found, other), expected, rtol=1e-12)


@pytest.mark.parametrize(
    "name, channel", [("torque-offset", "torque"), ("drawbar-offset", "drawbar_pull")]
)
def test_the_zero_of_a_sensor_turns_around_in_reverse(name, channel):
    at = replace(AT, speed=np.where(np.arange(np.size(AT.slip)) % 2, -0.05, 0.05))
    found = getattr((WHEEL + EFFECTS[name](offset=0.4))(SAND, at), channel)
    added = np.where(at.speed < 0.0, -0.4, 0.4)
    np.testing.assert_allclose(found, getattr(WHEEL(SAND, at), channel) + added, rtol=1e-12)


@pytest.mark.parametrize("error", [-0.2, -0.015, 0.015, 0.2])
def test_slip_from_a_wrong_speed_is_mended(error):
    rim_speed = 0.1
    speed = rim_speed * np.asarray([0.05, 0.3, 0.9, 0.99, 1.0, 1.01, 1.1, 2.0, 9.0])

    def slip(v):
        return np.where(v < rim_speed, 1.0 - v / rim_speed, rim_speed / v - 1.0)

    reported = Operating(slip=slip(speed * (1.0 + error)), load=60.0)
    mended = EFFECTS["slip-scale"](error=error).on_operating(reported, None)
    np.testing.assert_allclose(mended.slip, slip(speed), atol=1e-14)


@pytest.mark.parametrize("error", [-0.2, 0.2])
def test_mended_slip_stays_a_slip(error):
    most = 1.0 - 1e-9
    at = Operating(slip=np.asarray([-most, most]), load=60.0)
    for effect in (EFFECTS["slip-scale"](error=error), EFFECTS["slip-offset"](offset=error)):
        assert (np.abs(effect.on_operating(at, None).slip) <= most).all()


def test_a_slip_that_is_off_by_a_constant_is_mended():
    true, off = np.asarray([-0.4, 0.0, 0.1, 0.8]), 0.03
    reported = Operating(slip=true + off, load=60.0)
    model = WHEEL + EFFECTS["slip-offset"](offset=off)
    expected = WHEEL(SAND, Operating(slip=true, load=60.0))
    found = model(SAND, reported)
    for channel in CHANNELS:
        np.testing.assert_allclose(getattr(found, channel), getattr(expected, channel), rtol=1e-12)


def test_stresses_are_those_of_the_true_sinkage_whatever_the_sensor_says():
    expected = WHEEL.profile(SAND, AT)
    for effect in (EFFECTS["sinkage-offset"](offset=-0.05), EFFECTS["sinkage-gain"](gain=0.4)):
        found = (WHEEL + effect).profile(SAND, AT)
        np.testing.assert_array_equal(found.angle, expected.angle)
        np.testing.assert_array_equal(found.normal, expected.normal)
