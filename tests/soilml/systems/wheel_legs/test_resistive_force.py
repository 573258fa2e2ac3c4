"""Resistive-force terradynamics: a plate is resisted, from whichever side."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.resistive_force import (
    resistance,
    resistance_terms,
    stress_gains,
)

DOWN, FORWARD, BACKWARD, UP = 0.5 * np.pi, 0.0, np.pi, -0.5 * np.pi
BETA = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 37)


def test_a_flat_plate_pushed_straight_down_has_the_unit_gain_and_no_side_force():
    across, up = stress_gains(0.0, DOWN)
    assert up == pytest.approx(1.0, abs=1e-15)
    assert across == pytest.approx(0.0, abs=1e-15)


def test_going_backwards_is_the_mirror_image():
    beta, gamma = np.meshgrid(BETA, np.linspace(-1.5, 1.5, 21))
    ahead_x, ahead_z = stress_gains(beta, gamma)
    back_x, back_z = stress_gains(-beta, np.pi - gamma)
    np.testing.assert_allclose(back_x, -ahead_x, atol=1e-14)
    np.testing.assert_allclose(back_z, ahead_z, atol=1e-14)


def test_the_form_without_angles_is_the_same_law():
    rng = np.random.default_rng(3)
    beta, gamma = rng.uniform(-4, 4, (2, 500))
    across, up = stress_gains(beta, gamma)
    x, z = resistance(np.cos(2 * beta), np.sin(2 * beta), np.cos(gamma), -np.sin(gamma))
    np.testing.assert_allclose(x, -across, atol=1e-14)
    np.testing.assert_allclose(z, up, atol=1e-14)


def test_the_motion_dependent_part_always_dissipates():
    _, _, xx, xz, zx, zz = resistance_terms(np.cos(2 * BETA), np.sin(2 * BETA))
    assert np.all(xx > 0) and np.all(4 * xx * zz > (xz + zx) ** 2)
