"""Each effect of the catalogue against a formula, a limit or a published number.

Soil and running gear first, then rig and sensors. `test_effects.py` asks that every effect of the
catalogue has a test here.
"""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, LinearWheel, Model, Operating, Wheel, soil
from soilml.physics.contact import Contact, Stress, stress
from soilml.physics.effects.forces_beside import buried
from soilml.physics.forces import forces_at_sinkage
from soilml.physics.load_case import LoadCase

SAND = soil("wong1989/dry_sand")
GEAR = Wheel(radius=0.15, width=0.12)
WHEEL = Model(GEAR)
AT = Operating(slip=np.linspace(0.15, 0.7, 8), load=60.0)
CHANNELS = ("torque", "drawbar_pull", "sinkage")
#: For effects of rig and sensors: driving and braking.
RIG_AT = Operating(slip=np.asarray([-0.4, -0.1, 0.15, 0.4, 0.7]), load=60.0)
RIG_PLAIN = WHEEL(SAND, RIG_AT)


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


def test_the_hyperbola_mobilises_half_the_strength_at_its_modulus_and_nine_tenths_at_nine():
    modulus = SAND.shear_modulus
    before, scene = sheared_by(modulus * np.asarray([1e-9, 1.0, -9.0]))
    effect = EFFECTS["hyperbolic-shear"](share=1.0)
    curve = np.abs(effect.on_stress(before, scene).shear) / strength(before)
    assert curve == pytest.approx([1e-9, 0.5, 0.9])
    half = replace(effect, share=0.5).on_stress(before, scene).shear
    full = effect.on_stress(before, scene).shear
    np.testing.assert_allclose(half, 0.5 * (before.shear + full), rtol=1e-12)


def pressed(normal, ground=SAND):
    """Fully sheared points under these normal stresses (Pa), without a gear."""
    found, scene = sheared_by(np.full(len(normal), 1.0), ground=ground)
    found = replace(found, normal=np.asarray(normal, dtype=float))
    return replace(found, shear=strength(found, ground)), scene


def test_on_a_curved_envelope_friction_falls_with_the_normal_stress():
    before, scene = pressed([0.0, 1e4, 4e4])
    found = EFFECTS["curved-envelope"](exponent=0.5).on_stress(before, scene)
    friction = np.tan(SAND.friction_angle) * np.asarray([0.0, 1e4, 2e4])
    np.testing.assert_allclose(found.shear, SAND.cohesion + friction, rtol=1e-12)
    np.testing.assert_array_equal(found.normal, before.normal)


@pytest.mark.parametrize("slip", [0.3, -0.3])
@pytest.mark.parametrize(
    "name, shape",
    [
        ("elliptic-pressure", lambda x: np.sqrt(1 - x**2)),
        ("parabolic-pressure", lambda x: 1 - x**2),
    ],
)
def test_pressure_of_another_shape_has_the_maximum_of_bekkers(name, shape, slip):
    model = WHEEL + EFFECTS["exit-angle"](kappa=0.2) + EFFECTS[name](share=1.0)
    found = model.profile(SAND, replace(AT, slip=slip), 801)
    angle, normal = found.angle, found.normal
    first, last = angle[0], angle[-1]
    peak = (SAND.a0 + SAND.a1 * slip) * first
    depth = 0.15 * (np.cos(peak) - np.cos(first))
    largest = (SAND.kc / 0.12 + SAND.kphi) * depth**SAND.n
    side = np.where(angle > peak, first - peak, peak - last)
    np.testing.assert_allclose(
        normal, largest * shape(np.minimum(np.abs(angle - peak) / side, 1.0)), atol=1e-5 * largest
    )
    # the soil carries the load, and friction is that of the new pressure
    across = np.trapezoid(-normal * np.cos(angle) - found.shear * np.sin(angle), angle, axis=0)
    np.testing.assert_allclose(across * 0.15 * 0.12, 60.0, rtol=2e-3)
    ratio = np.abs(found.shear) / (SAND.cohesion + normal * np.tan(SAND.friction_angle))
    assert (ratio <= 1.0).all() and ratio.max() > 0.3


def test_pressure_saturates_at_its_limit():
    before, scene = pressed([0.0, 1e3, 5e4, 1e8])
    found = EFFECTS["saturating-pressure"](softness=2e-5).on_stress(before, scene)
    expected = 5e4 * np.asarray([0.0, 1 - np.exp(-0.02), 1 - np.exp(-1.0), 1.0])
    np.testing.assert_allclose(found.normal, expected, rtol=1e-12)
    np.testing.assert_allclose(found.shear, strength(found), rtol=1e-12)


def test_a_base_doubles_the_pressure_at_its_depth():
    before, scene = pressed([2e4, 3e4])  # 1 cm deep
    found = EFFECTS["firm-base"](nearness=100.0, steepness=3.0).on_stress(before, scene)
    np.testing.assert_allclose(found.normal, [4e4, 6e4], rtol=1e-12)
    deeper = EFFECTS["firm-base"](nearness=50.0, steepness=3.0).on_stress(before, scene)
    np.testing.assert_allclose(deeper.normal, [2e4 * 1.125, 3e4 * 1.125], rtol=1e-12)
    np.testing.assert_allclose(deeper.shear, strength(deeper), rtol=1e-12)


@pytest.mark.parametrize("width", [0.05, 0.1, 0.2])
def test_reeces_pressure_depends_on_sinkage_over_width(width):
    ground = replace(SAND, n=0.7)
    # k1 and k2 at which the two laws agree for a width of 0.1 m
    k1, k2 = (k * 0.1 ** (ground.n - 1.0) for k in (ground.kc, ground.kphi))
    gear = Wheel(radius=0.15, width=width)
    modulus = (k1 + k2 * width) / width**ground.n
    other = replace(ground, kc=0.0, kphi=modulus)
    same((Model(gear) + EFFECTS["reece-width"](share=1.0))(ground, AT), Model(gear)(other, AT))


@pytest.mark.parametrize("slip", [0.3, 0.02, -0.3])
def test_a_rim_that_lies_flat_is_an_arc_a_chord_and_nothing_behind_it(slip):
    at = Operating(slip=slip, load=60.0)
    found = (WHEEL + EFFECTS["flat-rim"](compliance=5e-5))(SAND, at)
    r, b, z, deflection = 0.15, 0.12, found.sinkage, 5e-5 * 60.0
    entry, half = np.arccos(1.0 - (z + deflection) / r), np.arccos(1.0 - deflection / r)
    # from entry to exit: the arc by its angle, then the chord by its distance ahead of the axle
    height = r - deflection
    theta, x = (
        np.linspace(entry, half, 40001),
        np.linspace(r * np.sin(half), -r * np.sin(half), 40001),
    )
    angle = np.concatenate([theta, np.arctan(x / height)])
    step = np.concatenate([[0.0], r * -np.diff(theta), [0.0], -np.diff(x)])
    level = np.concatenate([theta, 0.0 * x])
    peak = (SAND.a0 + SAND.a1 * slip) * entry
    mirrored = entry - (angle + half) / (peak + half) * (entry - peak)
    depth = r * (np.cos(np.where(angle > peak, angle, mirrored)) - np.cos(entry))
    normal = (SAND.kc / b + SAND.kphi) * np.clip(depth, 0.0, z) ** SAND.n
    travel = 1.0 - slip if slip > 0 else 1.0 / (1.0 + slip)
    rate = 1.0 - travel * np.cos(level)
    j = np.cumsum(np.concatenate([[0.0], 0.5 * (rate[1:] + rate[:-1])]) * step)
    strengths = SAND.cohesion + normal * np.tan(SAND.friction_angle)
    shear = np.sign(j) * strengths * (1.0 - np.exp(-np.abs(j) / SAND.shear_modulus))
    ahead = np.concatenate([0.0 * theta, x])
    lever = np.concatenate([r + 0.0 * theta, height + 0.0 * x])

    def total(density):
        return b * np.sum(0.5 * (density[1:] + density[:-1]) * step[1:])

    load = total(normal * np.cos(level) + shear * np.sin(level))
    pull = total(shear * np.cos(level) - normal * np.sin(level))
    torque = total(shear * lever + normal * ahead)
    assert load == pytest.approx(60.0, rel=1e-4)
    assert float(found.drawbar_pull) == pytest.approx(pull, rel=1e-3, abs=2e-3)
    assert float(found.torque) == pytest.approx(torque, rel=1e-3, abs=2e-4)


@pytest.mark.parametrize("slip", [0.3, -0.3])
def test_a_clogged_wheel_is_a_larger_one_at_another_slip(slip):
    ground = replace(SAND, a1=0.0)  # the maximum stress does not move with slip
    found = (WHEEL + EFFECTS["clogging"](layer=0.01))(ground, Operating(slip=slip, load=60.0))
    travel = (1.0 - slip if slip > 0 else 1.0 / (1.0 + slip)) * 0.15 / 0.16
    true = 1.0 - travel if travel < 1.0 else 1.0 / travel - 1.0
    larger = Model(Wheel(radius=0.16, width=0.12))(ground, Operating(slip=true, load=60.0))
    same(found, larger)


@pytest.mark.parametrize("slip", [0.3, -0.3])
def test_an_inclined_wheel_is_the_mean_of_slices_across_its_width(slip):
    at = Operating(slip=np.asarray([slip]), load=np.asarray([60.0]))
    found = (WHEEL + EFFECTS["camber"](angle=0.2))(SAND, at)

    def upright(sinkage):
        return forces_at_sinkage(WHEEL.load_case(SAND, at)[0], sinkage)

    slices = found.sinkage + np.sin(0.2) * np.linspace(-0.06, 0.06, 2001)[:, None]
    forces = [upright(z) for z in slices]
    for name, expected in (("load", 60.0 / np.cos(0.2)), ("torque", None), ("drawbar_pull", None)):
        mean = np.mean([getattr(f, name) for f in forces], axis=0)
        value = getattr(found, name) if expected is None else expected
        np.testing.assert_allclose(value, mean, rtol=0.01, err_msg=name)
    d = 0.12 * np.sin(0.2) / np.sqrt(12.0)
    deep, high = upright(found.sinkage + d), upright(found.sinkage - d)
    for name in ("torque", "drawbar_pull"):
        both = 0.5 * (getattr(deep, name) + getattr(high, name))
        np.testing.assert_allclose(getattr(found, name), both, rtol=1e-9)


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


def test_grousers_of_a_track_shear_soil_on_soil_and_beside_the_track():
    before, scene = sheared_by(SAND.shear_modulus * np.asarray([0.75, 3.0, 30.0]))
    effect = EFFECTS["track-grousers"](spacing=0.8, height=0.02, yielding=3.0, power=0.5)
    sides = 1.0 + 2.0 * 0.02 / GEAR.width
    block = SAND.cohesion * sides + before.normal * np.tan(SAND.friction_angle)
    expected = 0.2 * before.shear + 0.8 * block * np.asarray([0.5, 1.0, 1.0])
    np.testing.assert_allclose(effect.on_stress(before, scene).shear, expected, rtol=1e-12)


@pytest.mark.parametrize("b0", [-1.0, -0.3])
def test_an_exit_angle_given_as_a_share_of_the_entry_lies_behind_the_axle(b0):
    at = replace(AT, slip=np.asarray([0.3]))
    rim = GEAR.contact_geometry(np.asarray([0.02]), SAND, at)
    found = EFFECTS["exit-angle"](b0=b0).on_contact(rim, LoadCase(GEAR, SAND, at))
    np.testing.assert_allclose(found.exit, b0 * rim.entry, rtol=1e-12)
    kappa = EFFECTS["exit-angle"](kappa=0.2).on_contact(rim, LoadCase(GEAR, SAND, at))
    np.testing.assert_allclose(kappa.exit, -np.arccos(1.0 - 0.2 * 0.02 / 0.15), rtol=1e-9)


def test_the_soil_of_a_campaign_drifts_from_its_first_row_on():
    for progress, share in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (None, 1.0)):
        at = replace(AT, progress=progress)
        firm = {k: getattr(SAND, k) * np.exp(0.4 * share) for k in ("kc", "kphi")}
        found = (WHEEL + EFFECTS["bearing-drift"](growth=0.4))(SAND, at)
        same(found, WHEEL(replace(SAND, **firm), AT))
        cohesive = replace(SAND, cohesion=SAND.cohesion + 600.0 * share)
        same((WHEEL + EFFECTS["cohesion-drift"](gain=600.0))(SAND, at), WHEEL(cohesive, AT))
        dense = replace(SAND, friction_angle=SAND.friction_angle + 0.05 * share)
        same((WHEEL + EFFECTS["friction-drift"](gain=0.05))(SAND, at), WHEEL(dense, AT))
    dry = (WHEEL + EFFECTS["cohesion-drift"](gain=-1e4))(SAND, AT)
    same(dry, WHEEL(replace(SAND, cohesion=0.0), AT))


def test_weight_pulls_back_on_a_slope_and_forward_in_reverse():
    model = WHEEL + EFFECTS["slope"](angle=0.2)
    flat = WHEEL(SAND, replace(RIG_AT, load=60.0 * np.cos(0.2)))
    up, down = (model(SAND, replace(RIG_AT, speed=v)) for v in (0.1, -0.1))
    np.testing.assert_allclose(up.drawbar_pull, flat.drawbar_pull - 60.0 * np.sin(0.2))
    np.testing.assert_allclose(0.5 * (up.drawbar_pull + down.drawbar_pull), flat.drawbar_pull)
    np.testing.assert_array_equal(model(SAND, RIG_AT).drawbar_pull, up.drawbar_pull)
    np.testing.assert_allclose(up.torque, flat.torque)


def test_the_soil_carries_what_the_pull_presses_down():
    found = (WHEEL + EFFECTS["load-transfer"](ratio=0.2, offset=3.0))(SAND, RIG_AT)
    true = WHEEL(SAND, replace(RIG_AT, load=63.0 + 0.2 * found.drawbar_pull))
    for channel in CHANNELS:
        np.testing.assert_allclose(getattr(found, channel), getattr(true, channel), rtol=1e-7)


def test_a_bearing_rubs_under_the_load_that_it_carries():
    found = (WHEEL + EFFECTS["bearing-friction"](coefficient=0.02))(SAND, RIG_AT)
    np.testing.assert_allclose(found.torque - RIG_PLAIN.torque, 0.02 * 60.0 * 0.15)
    weighed = WHEEL + EFFECTS["load-gain"](gain=0.25) + EFFECTS["bearing-friction"](coefficient=0.1)
    np.testing.assert_allclose(
        weighed(SAND, RIG_AT).torque - WHEEL(SAND, replace(RIG_AT, load=48.0)).torque,
        0.1 * 48.0 * 0.15,
    )


@pytest.mark.parametrize(
    "effect, known",
    [
        (EFFECTS["load-gain"](gain=0.25), {"load": 48.0}),
        (EFFECTS["slip-offset"](offset=0.03), {"slip": RIG_AT.slip - 0.03}),
    ],
)
def test_a_cell_or_encoder_that_is_off_reads_another_load_or_slip(effect, known):
    same((WHEEL + effect)(SAND, RIG_AT), WHEEL(SAND, replace(RIG_AT, **known)))


def test_a_load_cell_that_lags_reads_too_little_while_loads_rise():
    model = WHEEL + EFFECTS["load-hysteresis"](error=0.2)
    for direction, load in ((1.0, 75.0), (-1.0, 50.0), (0.0, 60.0), (None, 60.0)):
        found = model(SAND, replace(RIG_AT, load_direction=direction))
        same(found, WHEEL(SAND, replace(RIG_AT, load=load)))


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
    found = (WHEEL + EFFECTS[name](**{EFFECTS[name].about.size: size}))(SAND, RIG_AT)
    for other in CHANNELS:
        exact = getattr(RIG_PLAIN, other)
        expected = times * exact + more if other == channel else exact
        np.testing.assert_allclose(getattr(found, other), expected, rtol=1e-12)


@pytest.mark.parametrize(
    "name, channel", [("torque-offset", "torque"), ("drawbar-offset", "drawbar_pull")]
)
def test_the_zero_of_a_sensor_turns_around_in_reverse(name, channel):
    at = replace(RIG_AT, speed=np.where(np.arange(np.size(RIG_AT.slip)) % 2, -0.05, 0.05))
    found = getattr((WHEEL + EFFECTS[name](offset=0.4))(SAND, at), channel)
    added = np.where(at.speed < 0.0, -0.4, 0.4)
    np.testing.assert_allclose(found, getattr(WHEEL(SAND, at), channel) + added, rtol=1e-12)


@pytest.mark.parametrize("error", [-0.2, -0.015, 0.015, 0.2])
def test_slip_from_a_wrong_speed_is_corrected(error):
    rim_speed = 0.1
    speed = rim_speed * np.asarray([0.05, 0.3, 0.9, 0.99, 1.0, 1.01, 1.1, 2.0, 9.0])

    def slip(v):
        return np.where(v < rim_speed, 1.0 - v / rim_speed, rim_speed / v - 1.0)

    reported = Operating(slip=slip(speed * (1.0 + error)), load=60.0)
    found = EFFECTS["slip-scale"](error=error).on_operating(reported, None)
    np.testing.assert_allclose(found.slip, slip(speed), atol=1e-14)


def test_stresses_are_those_of_the_true_sinkage_whatever_the_sensor_says():
    expected = WHEEL.profile(SAND, RIG_AT)
    for effect in (EFFECTS["sinkage-offset"](offset=-0.05), EFFECTS["sinkage-gain"](gain=0.4)):
        found = (WHEEL + effect).profile(SAND, RIG_AT)
        np.testing.assert_array_equal(found.angle, expected.angle)
        np.testing.assert_array_equal(found.normal, expected.normal)


def test_a_soft_crust_takes_a_constant_pressure_where_the_ground_bears_much():
    before, scene = pressed([100.0, 2e3, 1e6])
    found = EFFECTS["soft-crust"](deficit=2000.0).on_stress(before, scene)
    lost = 2000.0 * np.asarray([1 - np.exp(-0.05), 1 - np.exp(-1.0), 1.0])
    np.testing.assert_allclose(found.normal, [100.0, 2e3, 1e6] - lost, rtol=1e-12)
    np.testing.assert_allclose(found.shear, strength(found), rtol=1e-12)
