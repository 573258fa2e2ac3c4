"""Pull efficiency against its integrals, and what a soil's class must do."""

import numpy as np
import pytest
from reference import equilibrium, row_of, stresses
from scipy.integrate import quad

from soilml import Model, Operating, Wheel, soil
from soilml.physics.pull_efficiency import (
    CLASSES,
    pull_efficiency,
    tractive_efficiency,
    traffic_class,
)

WHEEL = Model(Wheel(radius=0.15, width=0.18))
AT = Operating(slip=0.2, load=490.5)


def test_it_is_one_less_the_resistance_over_the_thrust_by_quadrature():
    ground = soil("comin2017/es-3")
    row = row_of(ground, radius=0.15, width=0.18, slip=0.2, load=490.5)
    theta1, _, _ = equilibrium(row)
    peak = (ground.a0 + ground.a1 * 0.2) * theta1
    ends = [peak, theta1 - 0.1, theta1 - 0.02]

    def total(f):
        return quad(f, 0, theta1, points=ends, limit=300)[0]

    thrust = total(lambda t: stresses(t, theta1, 0.0, row)[1] * np.cos(t))
    resistance = total(lambda t: stresses(t, theta1, 0.0, row)[0] * np.sin(t))
    expected = 1.0 - resistance / thrust
    assert pull_efficiency(WHEEL, ground, AT) == pytest.approx(expected, rel=1e-5)


def test_the_four_soils_stand_in_the_published_order_at_any_width_and_slip():
    for width in (0.15, 0.18, 0.21):
        for slip in (0.1, 0.3, 0.5):
            found = [
                pull_efficiency(
                    Model(Wheel(radius=0.15, width=width)),
                    soil(f"comin2017/{name}"),
                    Operating(slip=slip, load=490.5),
                )
                for name in ("ssc-3", "ssc-1", "es-3", "ssc-2")
            ]
            assert (np.diff(found) > 0).all(), (width, slip)


def test_a_soil_that_does_not_carry_is_not_to_be_driven_on():
    value = pull_efficiency(WHEEL, soil("comin2017/ssc-1"), Operating(slip=0.2, load=1e5))
    assert np.isnan(value) and traffic_class(value) == CLASSES[0]


def test_tractive_efficiency_is_power_at_the_drawbar_over_that_of_the_drive():
    # v = 0.8 * 0.15 m * 2 rad/s = 0.24 m/s: 30 N * 0.24 m/s over 9 N m * 2 rad/s
    assert tractive_efficiency(0.15, 0.2, 9.0, 30.0) == pytest.approx(30.0 * 0.24 / 18.0)
    assert np.isnan(tractive_efficiency(0.15, np.asarray([0.0, -0.2, 0.2]), [9, 9, -1], 30.0)).all()
