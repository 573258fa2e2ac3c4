"""The soil, and the slip, from strides by the printed relations; what the soil means."""

import numpy as np
import pytest

from soilml.systems.wheel_legs import mobility, soil_of_strides
from soilml.systems.wheel_legs.resistive_force import GROUNDS
from soilml.systems.wheel_legs.stride_relations import (
    ASSUMED_SPRING,
    GRAVITY,
    SPRING,
    SPRING_OF_SOIL,
    TORQUE,
    TORQUE_SLIP,
    VIBRATION,
    VIBRATION_SLIP,
    affine,
)

ANGLE, STIFFNESS = 0.7, 1.6e4
SLIPS = np.asarray([0.0, 0.125, 0.25, 0.375, 0.5])
#: Mean errors of the friction angle on the four soils by torque, vibration and sinkage.
TABLE_VIII = 0.01 * np.asarray([[-7, -9, 21, 4], [1, 3, 5, 23], [-17, -8, 4, 2]])


def test_the_relations_are_the_printed_ones():
    """Eqs. 18, 19, 24 and 28 written out, in the printed units."""
    a, b = TORQUE_SLIP["terramechanics"].line(ANGLE, STIFFNESS)
    assert 0.661 - 0.466 * b - 0.377 * a == pytest.approx(ANGLE)
    assert -0.356 + 1.434 * b == pytest.approx(STIFFNESS / 1e4)
    a, b = TORQUE_SLIP["empirical"].line(ANGLE, STIFFNESS)
    assert 1.0 - 0.58 * b == pytest.approx(ANGLE)
    assert -0.7 + 20.928 * b + 15.997 * a == pytest.approx(STIFFNESS / 1e4)
    drop, spring = affine(SPRING_OF_SOIL, ANGLE, STIFFNESS)
    assert affine(SPRING, drop, spring) == pytest.approx([ANGLE, STIFFNESS])
    degrees = np.rad2deg(drop)
    for name, intercept, by_spring in (("planar", -1.434, 0.789), ("linear", -0.882, 0.0)):
        a, b = VIBRATION_SLIP[name].line(ANGLE, STIFFNESS)
        assert a == pytest.approx(intercept + 0.022 * degrees + by_spring * spring / 1e3)
        assert b * GRAVITY == pytest.approx(6.609 - 0.156 * degrees)
    one, slope = TORQUE.soil(1.1, 0.25).mean, (0.25 + 0.33) / 1.1
    assert one[0] == pytest.approx(1.0 - 0.58 * slope)
    assert one[1] / 1e4 == pytest.approx(-0.7 + 20.928 * slope - 15.997 * 0.33)


@pytest.mark.parametrize("relation", [TORQUE, VIBRATION], ids=["torque", "vibration"])
def test_readings_on_the_line_of_a_soil_give_its_angle(relation):
    drop = affine(SPRING_OF_SOIL, ANGLE, STIFFNESS)[0]
    stiffness = STIFFNESS if relation is TORQUE else affine(SPRING, drop, ASSUMED_SPRING)[1]
    angle = ANGLE if relation is TORQUE else affine(SPRING, drop, ASSUMED_SPRING)[0]
    a, b = relation.line(angle, stiffness)
    assert relation.soil((SLIPS - a) / b, SLIPS).mean[0] == pytest.approx(float(angle))


def test_in_the_units_used_the_four_soils_slip_as_tested_for_tenths_of_g():
    angle = np.asarray([ground.friction_angle for ground in GROUNDS.values()])
    sigma = np.asarray([ground.normal_stiffness for ground in GROUNDS.values()])
    drop, spring = affine(SPRING_OF_SOIL, angle, sigma)
    assert ((np.rad2deg(drop) > 30) & (np.rad2deg(drop) < 42)).all()
    assert ((spring > 700) & (spring < 1000)).all()
    a, b = VIBRATION_SLIP["planar"].line(angle, sigma)
    at_half = (0.5 - a) / b / GRAVITY  # g, at a slip of 0.5
    assert ((a > -0.2) & (a < 0.25) & (at_half > 0.2) & (at_half < 1.5)).all()


def test_more_pairs_reduce_the_error_of_strides_and_not_that_of_the_soil():
    one, many = (TORQUE.soil(np.full(n, 1.0), np.full(n, 0.2)) for n in (1, 4))
    assert many.deviations == pytest.approx(one.deviations)
    assert many.of_strides == pytest.approx(one.of_strides / 4)


@pytest.mark.parametrize("strides", [3, 60])
def test_intervals_cover_soils_whose_errors_are_of_the_size_of_table_viii(strides):
    """Sensors err by a share of their own on each soil, and their slip in each stride.

    Above an angle of 0.75 the printed relation of vibration is singular: no sensor is to see that.
    """
    rng, inside = np.random.default_rng(strides), []
    shear, spring = TORQUE, VIBRATION
    for _ in range(1000):
        angle, slip = rng.uniform(0.5, 0.58), rng.uniform(0.05, 0.45, strides)
        shares = 0.5 * TABLE_VIII @ rng.standard_normal(4)  # second moments are those of its soils
        by_torque, by_vibration, by_sinkage = angle * (1.0 + shares)
        noise = rng.standard_normal((2, strides))
        drop = np.deg2rad((by_vibration + 0.76 - 0.35e-3 * ASSUMED_SPRING) / 0.03)
        a, b = spring.line(*affine(SPRING, drop, ASSUMED_SPRING))
        readings = {
            "torque": (slip + shear.slip_std * noise[0] + 0.33) / ((by_torque - 1.0) / -0.58),
            "vibration": (slip + spring.slip_std * noise[1] - a) / b,
            "sinkage": np.full(strides, max((by_sinkage - 0.76) / -7.0, 1e-3)),
        }
        found = soil_of_strides(slip, readings)
        inside.append(np.abs(found.mean[:, 0] - angle) < 1.645 * found.std[:, 0])
    covered = dict(zip((*readings, "fused"), np.mean(inside, axis=0), strict=True))
    assert all(0.85 < share < 0.95 for share in covered.values()), covered


def test_a_firm_soil_is_better_for_a_heavy_rover_than_a_weak_one():
    """The same strides with another torque; what is known of the soil narrows the answer."""
    weak, firm = (soil_of_strides([0.25], {"torque": [t], "sinkage": [0.012]}) for t in (0.7, 1.4))
    found, better = mobility(weak), mobility(firm)
    assert found.efficiency < better.efficiency
    assert sum(better.probability.values()) == pytest.approx(1.0)
    known = mobility(firm, known={"n": 0.7, "cohesion": 1000.0, "shear_modulus": 0.002})
    assert known.ends[1] - known.ends[0] < better.ends[1] - better.ends[0]
