"""Wheel-legs walking: what carries, what propels, and what stops."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.systems.wheel_legs.resistive_force import (
    FEET,
    GROUNDS,
    LinearGround,
    Section,
    WalkingLegs,
    wheel_leg,
)
from soilml.systems.wheel_legs.walk import WalkStatus, walk

pytestmark = pytest.mark.slow

SAND = LinearGround(stiffness=0.7e6)
WEIGHT = 3.75 * 9.81
STRIDE = 2 * np.pi / 5
FREE = np.asarray([np.nan])


@pytest.fixture(scope="module")
def slipping():
    return walk(wheel_leg("LTF"), SAND, slip=[0.0, 0.125, 0.25, 0.375, 0.5], turns=1, steps=500)


def test_the_ground_carries_the_weight_over_a_stride():
    fine = walk(wheel_leg("LTF"), SAND, turns=1, steps=1000)
    given = WalkingLegs.of([wheel_leg("LTF")], [SAND], FREE)
    up = [
        given.reaction(given.at(a), z, vx, vz)[0][1]
        for a, z, vx, vz in zip(fine.angle, fine.z, fine.vx, fine.vz, strict=True)
    ]
    assert np.mean(up[-200:]) == pytest.approx(WEIGHT, rel=1e-3)


def test_a_commanded_slip_is_the_slip_that_comes_out(slipping):
    late = slipping.after(STRIDE)
    np.testing.assert_allclose(
        late.slip, np.broadcast_to([0, 0.125, 0.25, 0.375, 0.5], late.slip.shape)
    )


def test_a_case_does_not_depend_on_the_batch():
    cases = [wheel_leg("none", legs=3), wheel_leg("CIF"), wheel_leg("LTF", legs=6)]
    together = walk(cases, SAND, turns=0.5, steps=500)
    for i, case in enumerate(cases):
        alone = walk(case, SAND, turns=0.5, steps=500)
        np.testing.assert_allclose(together.z[:, i], alone.z[:, 0], atol=1e-7)
        np.testing.assert_allclose(together.x[:, i], alone.x[:, 0], atol=1e-6)


def test_long_steps_agree_with_the_papers_short_ones():
    """Eq. 8 with explicit steps of 1e-4 s, forces at their start."""
    fast = walk(wheel_leg("LTF"), SAND, turns=0.05, steps=1000)
    given, dt = WalkingLegs.of([wheel_leg("LTF")], [SAND], FREE), 1e-4
    x, z, vx, vz = (part[0].copy() for part in (fast.x, fast.z, fast.vx, fast.vz))
    angles, heights = np.arange(0.0, fast.angle[-1], 0.3 * dt), []
    for angle in angles:
        heights.append(float(z[0]))
        (ahead, up, _), _ = given.reaction(given.at(angle), z, vx, vz)
        vx, vz = vx + ahead / 3.75 * dt, vz + (up / 3.75 - 9.81) * dt
        x, z = x + vx * dt, z + vz * dt
    np.testing.assert_allclose(np.interp(fast.angle, angles, heights), fast.z[:, 0], atol=1e-3)
    assert fast.x[-1, 0] == pytest.approx(float(x[0]), rel=0.02)


def test_the_jacobian_of_the_reaction_is_its_derivative():
    cases = [wheel_leg("LTF"), wheel_leg("CIF", legs=3)]
    given = WalkingLegs.of(cases, [SAND, GROUNDS["SSC-2"]], np.full(2, np.nan))
    at = given.at(0.3)
    here = (np.array([0.1, 0.13]), np.array([0.04, 0.03]), np.array([-0.01, 0.02]))
    rates = given.reaction(at, *here)[1]
    for i, order in enumerate((2, 0, 1)):  # height, velocity ahead and up
        step = [np.zeros(2)] * 3
        step[i] = np.full(2, 1e-7)
        ahead, behind = (
            given.reaction(at, *(h + sign * d for h, d in zip(here, step, strict=True)))[0][:2]
            for sign in (1, -1)
        )
        np.testing.assert_allclose(rates[:, order], (ahead - behind) / 2e-7, rtol=1e-4, atol=1e-2)


def test_cases_without_a_walk_have_a_status_and_do_not_affect_the_others():
    good = wheel_leg("LTF")
    stub = replace(good, foot=FEET["none"], leg=Section(10, 0.016, 0.015, 0.002))
    hung = wheel_leg("none", legs=1, body_area=0.0)
    walked = walk([good, stub, hung], SAND, turns=0.3, steps=500)
    assert [WalkStatus(code).name for code in walked.status] == ["OK", "NO_CONTACT", "SUNK"]
    assert np.all(np.isfinite(walked.z[:, 0]))
    assert np.isnan(walked.sinkage[-1, 2]) and np.isnan(walked.slip[-1, 2])
    alone = walk(good, SAND, turns=0.3, steps=500)
    np.testing.assert_allclose(walked.z[:, 0], alone.z[:, 0], atol=1e-7)
