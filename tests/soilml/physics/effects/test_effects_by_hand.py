"""Each effect of soil and wheel against a formula, a limit or a published number."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, LinearWheel, Model, Operating, Wheel, soil
from soilml.physics.contact import Contact, Stress, stress
from soilml.physics.effects.soil.sidewall_shear import buried
from soilml.physics.load_case import LoadCase

SAND = soil("wong1989/dry_sand")
GEAR = Wheel(radius=0.15, width=0.12)
WHEEL = Model(GEAR)
AT = Operating(slip=np.linspace(0.15, 0.7, 8), load=60.0)
CHANNELS = ("torque", "drawbar_pull", "sinkage")


def same(found, expected, channels=CHANNELS, rtol=1e-9):
    for channel in channels:
        np.testing.assert_allclose(
            getattr(found, channel), getattr(expected, channel), rtol=rtol, err_msg=channel
        )


def sheared_by(displacement, rolled=0.0, ground=SAND, at=AT):
    """Janosi and Hanamoto's stress 1 cm deep after shearing this far, without a gear."""
    along = np.asarray(displacement, dtype=float)
    one = np.ones_like(along)
    contact = Contact(0.01 * one, along, rolled + 0.0 * along, one, one, 0.0 * one, one, GEAR.width)
    return stress(contact, ground, replace(at, slip=0.3)), LoadCase(
        GEAR, ground, replace(at, slip=0.3)
    )


def strength(found: Stress, ground=SAND):
    return ground.cohesion + found.normal * np.tan(ground.friction_angle)


def test_slip_sinkage_raises_the_exponent():
    effect = EFFECTS["slip-sinkage"](n1=0.4)
    with_effect = (WHEEL + effect)(SAND, AT)
    by_hand = WHEEL(replace(SAND, n=SAND.n + 0.4 * AT.slip), AT)
    np.testing.assert_allclose(with_effect.torque, by_hand.torque, rtol=1e-12)


def test_bulldozing_costs_drawbar_pull_alone_and_as_its_formula_says():
    force, plain = (WHEEL + EFFECTS["bulldozing"](share=1.0))(SAND, AT), WHEEL(SAND, AT)
    np.testing.assert_array_equal(force.torque, plain.torque)
    np.testing.assert_array_equal(force.sinkage, plain.sinkage)
    tan = 2 / 3 * np.tan(SAND.friction_angle)
    phi = np.arctan(tan)
    n_q = np.exp(np.pi * tan) * np.tan(np.pi / 4 + phi / 2) ** 2
    n_c, n_gamma = (n_q - 1) / tan, 2 * (n_q + 1) * tan
    k_c = (n_c - tan) * np.cos(phi) ** 2
    k_gamma = (2 * n_gamma / tan + 1) * np.cos(phi) ** 2
    z, b = plain.sinkage, 0.12
    expected = b * (0.67 * SAND.cohesion * z * k_c + 0.5 * z**2 * SAND.unit_weight * k_gamma)
    np.testing.assert_allclose(plain.drawbar_pull - force.drawbar_pull, expected, rtol=1e-10)


@pytest.mark.parametrize("gear", [GEAR, LinearWheel(radius=0.15, width=0.12)])
@pytest.mark.parametrize("slip", [0.2, 0.0, -0.03, -0.4])
def test_the_slip_of_a_lugged_rim_is_converted_to_that_of_the_shear_radius(gear, slip):
    ground = replace(SAND, a1=0.0)  # the maximum stress does not move with slip
    ratio = 0.15 / (0.15 + 0.5 * 0.01)
    lugs = EFFECTS["grousers"](height=0.01, shearing=0.5)
    of_rim = (Model(gear) + replace(lugs, rim_slip=1.0))(ground, Operating(slip=slip, load=60.0))
    # v / (r omega) = 1 - s while driving and 1 / (1 + s) while braking
    travel = ratio * (1 - slip if slip >= 0 else 1 / (1 + slip))
    converted = 1 - travel if travel <= 1 else 1 / travel - 1
    of_lugs = (Model(gear) + lugs)(ground, Operating(slip=converted, load=60.0))
    same(of_rim, of_lugs)


def test_lugs_move_the_shearing_radius():
    lugged = (WHEEL + EFFECTS["grousers"](height=0.01, shearing=0.5))(SAND, AT)
    profile = (WHEEL + EFFECTS["grousers"](height=0.01, shearing=0.5)).profile(SAND, AT, 4001)
    # by hand: r b times the integral of the shear stress, at the lever arm r + h / 2
    arc = -np.trapezoid(profile.shear, profile.angle, axis=0) * 0.15 * 0.12
    np.testing.assert_allclose(lugged.torque, arc * 0.155, rtol=1e-4)


def test_a_small_wheel_feels_stress_over_the_front_thirty_of_seventy_degrees():
    sunk = np.asarray([0.15 * (1.0 - np.cos(np.deg2rad(70.0)))])
    at = replace(AT, slip=np.asarray([0.3]))
    rim = GEAR.contact_geometry(sunk, SAND, at)
    moved = EFFECTS["stress-shift"](shift=4 / 7).on_contact(rim, LoadCase(GEAR, SAND, at))
    assert np.rad2deg([moved.entry[0], moved.exit[0]]) == pytest.approx([70.0, 40.0])
    place = (moved.entry - moved.peak) / (moved.entry - moved.exit)
    assert place == pytest.approx((rim.entry - rim.peak) / rim.entry)
    # and no stress is left behind that arc
    profile = (WHEEL + EFFECTS["stress-shift"](shift=4 / 7)).profile(SAND, AT, 2001)
    np.testing.assert_allclose(profile.angle[-1], 4 / 7 * profile.angle[0], rtol=1e-12)
    across = np.trapezoid(
        -profile.normal * np.cos(profile.angle) - profile.shear * np.sin(profile.angle),
        profile.angle,
        axis=0,
    )
    np.testing.assert_allclose(across * 0.15 * 0.12, 60.0, rtol=1e-4)


def test_a_wheel_of_half_a_metre_feels_the_soil_as_a_plate_does():
    effect = EFFECTS["small-wheel-stiffness"](exponent=-0.5)
    large = Model(Wheel(radius=0.25, width=0.12))
    same((large + effect)(SAND, AT), large(SAND, AT))
    small = Wheel(radius=0.0625, width=0.12)  # a quarter of it: twice as stiff at m = -1/2
    stiff = replace(SAND, kc=2 * SAND.kc, kphi=2 * SAND.kphi)
    same((Model(small) + effect)(SAND, AT), Model(small)(stiff, AT))


def test_a_flexible_wheel_is_a_larger_rigid_one_with_the_lever_of_its_own_radius():
    effect = EFFECTS["wheel-flexibility"](compliance=5e-5)
    flexible = (WHEEL + effect)(SAND, AT)
    deflection = 5e-5 * 60.0
    substitute = 0.15 * (1.0 + deflection / flexible.sinkage)
    rigid = Model(Wheel(radius=substitute, width=0.12))(SAND, AT)
    same(flexible, rigid, ("drawbar_pull", "sinkage", "entry_angle"))
    np.testing.assert_allclose(flexible.torque, rigid.torque * 0.15 / substitute, rtol=1e-9)
    # where a wheel lowered by its deflection meets the surface, and where the substitute does
    lowered = np.sqrt(0.15**2 - (0.15 - deflection - flexible.sinkage) ** 2)
    reach = substitute * np.sin(flexible.entry_angle)
    np.testing.assert_allclose(reach, lowered, rtol=0.02)


def test_the_hump_of_the_shear_curve_is_one_at_its_peak_and_falls_to_the_residual():
    modulus = SAND.shear_modulus
    before, scene = sheared_by(modulus * np.asarray([1e-9, 2.0, 300.0]))
    effect = EFFECTS["shear-softening"](share=1.0, residual=0.6, peak=2.0)
    curve = effect.on_stress(before, scene).shear / strength(before)
    assert curve[1:] == pytest.approx([1.0, 0.6])
    start = 0.6 * (1.0 + (1.0 / (0.6 * (1.0 - np.exp(-1.0))) - 1.0) * np.e) / 2.0
    assert curve[0] == pytest.approx(1e-9 * start, rel=1e-6)
    half = replace(effect, share=0.5).on_stress(before, scene).shear
    full = effect.on_stress(before, scene).shear
    np.testing.assert_allclose(half, 0.5 * (before.shear + full), rtol=1e-12)


def test_side_walls_of_a_wheel_buried_to_the_hub_are_quarter_circles():
    area, depth = buried(np.asarray([np.pi / 2]))
    assert area == pytest.approx(np.pi / 4)
    assert depth == pytest.approx(4 / (3 * np.pi))
    entry = 1e-6  # nearly a parabola: two thirds of its box, two fifths of its depth
    area, depth = buried(np.asarray([entry]))
    assert area == pytest.approx(2 / 3 * entry * entry**2 / 2, rel=1e-9)
    assert depth == pytest.approx(0.4 * entry**2 / 2, rel=1e-9)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_side_walls_shear_as_their_formula_says(way):
    at = replace(AT, slip=way * AT.slip)
    force = (WHEEL + EFFECTS["sidewall-shear"](share=1.0))(SAND, at)
    plain = WHEEL(SAND, at)
    t, r, phi = plain.entry_angle, 0.15, SAND.friction_angle
    segment = t - np.sin(t) * np.cos(t)
    area, y = r**2 / 2 * segment, 2 * r * np.sin(t) ** 3 / (3 * segment)
    pressure = (1 - np.sin(phi)) * SAND.unit_weight * (y - r * np.cos(t))
    moved = r * (t - np.where(way > 0, 1 - at.slip, 1 / (1 + at.slip)) * np.sin(t))
    assert (np.sign(moved) == way).all()
    mobilised = 1 - np.exp(-np.abs(moved) / SAND.shear_modulus)
    shear = way * (SAND.cohesion + pressure * np.tan(phi)) * mobilised
    np.testing.assert_allclose(force.drawbar_pull - plain.drawbar_pull, 2 * shear * area, rtol=1e-8)
    np.testing.assert_allclose(force.torque - plain.torque, 2 * shear * area * y, rtol=1e-8)
    np.testing.assert_array_equal(force.sinkage, plain.sinkage)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_cohesion_that_grows_with_depth_is_friction_where_n_is_one(way):
    at = replace(AT, slip=way * AT.slip)
    straight = replace(SAND, n=1.0, kc=0.0)
    found = (WHEEL + EFFECTS["depth-cohesion"](c1=5e4))(straight, at)
    tan = np.tan(straight.friction_angle) + 5e4 / straight.kphi
    same(found, WHEEL(replace(straight, friction_angle=np.arctan(tan)), at))


def test_a_faster_wheel_meets_a_stronger_soil():
    for a, speed, times in (
        (0.1, 0.05, 1.0),
        (0.1, 0.05 * np.e, 1.1),
        (0.1, -0.05 * np.e, 1.1),
        (0.1, 0.05 / np.e, 0.9),
        (0.3, 0.0, 0.0),  # the law has run out long before, and stops at nothing
    ):
        tan = times * np.tan(SAND.friction_angle)
        other = replace(SAND, cohesion=times * SAND.cohesion, friction_angle=np.arctan(tan))
        found = (WHEEL + EFFECTS["rate"](a=a))(SAND, replace(AT, speed=speed))
        same(found, WHEEL(other, AT))


def test_the_fourth_pass_meets_twice_the_stiffness_where_it_grows_with_the_root():
    model = WHEEL + EFFECTS["multipass"](growth=0.5)
    same(model(SAND, replace(AT, pass_number=1.0)), WHEEL(SAND, AT))
    stiff = replace(SAND, kc=2 * SAND.kc, kphi=2 * SAND.kphi)
    same(model(SAND, replace(AT, pass_number=4.0)), WHEEL(stiff, AT))


def test_a_wheel_that_slides_sideways_shears_along_its_slip_velocity():
    modulus, beta = SAND.shear_modulus, 0.4
    ahead = modulus * np.asarray([3.0, -3.0, 0.0])
    rolled = 4.0 * modulus / (0.7 * np.tan(beta))  # 3 ahead and 4 aside are 5 in all
    before, scene = sheared_by(ahead, rolled)
    scene = replace(scene, at=replace(scene.at, slip_angle=beta))
    after = EFFECTS["lateral-slip"](share=1.0).on_stress(before, scene).shear
    expected = strength(before)[0] * (1.0 - np.exp(-5.0)) * 3.0 / 5.0
    np.testing.assert_allclose(after, [expected, expected, 0.0], rtol=1e-12)
    # the sign of the angle does not matter, and straight ahead nothing changes
    model = WHEEL + EFFECTS["lateral-slip"](share=1.0)
    right, left = (model(SAND, replace(AT, slip_angle=a)) for a in (0.2, -0.2))
    same(right, left, rtol=0)
    same(model(SAND, replace(AT, slip_angle=0.0)), WHEEL(SAND, AT), rtol=0)
