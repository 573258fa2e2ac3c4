"""A leg that sticks and slips, against what its equations say without integrating them."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.papers.comin2017_slip import fit_lines
from soilml.systems.wheel_legs.stances import (
    GRAVITY,
    SpringLeg,
    simulate_stance,
    vibration_amplitude,
)

pytestmark = pytest.mark.slow

LEG = SpringLeg(stiffness=4000.0, bending=0.5)
PHI, GAP = np.deg2rad(40.0), np.deg2rad(10.0)


def test_the_soil_breaks_when_the_push_leaves_the_friction_cone():
    found = simulate_stance(replace(LEG, damping=0.0), 0.3, PHI, GAP)
    first = int(np.argmax(found.foot_displacement > 0))
    # by hand: the leg of loaded length lags by omega t - beta and is bent by that
    angle = LEG.turning * found.time[first]
    standing = LEG.length - LEG.hub_mass * GRAVITY / LEG.stiffness
    reach = 0.7 * standing * np.sin(angle)

    def slope_of_push(z):
        span, beta = np.hypot(z, reach), np.arctan2(reach, z)
        axial = LEG.stiffness * (LEG.length - span)
        across = LEG.bending * LEG.stiffness * span * (angle - beta)
        up = axial * np.cos(beta) - across * np.sin(beta)
        return (axial * np.sin(beta) + across * np.cos(beta)) / up, up

    heights = np.linspace(0.9, 1.0, 4001) * LEG.length
    ratio, up = np.asarray([slope_of_push(z) for z in heights]).T
    at_rest = int(np.argmin(np.abs(up - LEG.hub_mass * GRAVITY)))
    assert ratio[at_rest] == pytest.approx(np.tan(PHI), rel=0.02)


def test_a_drop_of_friction_over_centimetres_makes_slip_linear_in_the_vibration():
    """Comin and Saaj 2017, eq. 24, on their four angles of friction; without it a threshold."""
    leg, angles = SpringLeg(stiffness=8000.0), np.deg2rad([42.3, 42.8, 29.1, 35.8])
    slips = np.linspace(0.05, 0.5, 10)

    def straight(each):
        shaken = vibration_amplitude(each, slips[:, None], angles, 0.3 * angles)
        return fit_lines(shaken, slips)[2]

    assert straight(replace(leg, softening=0.03)).min() > 0.93
    assert straight(leg).min() < 0.8
