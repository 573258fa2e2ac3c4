"""A braking wheel: continuous through zero slip, free rolling, locked, and by the printed law."""

import numpy as np
import pytest
from conftest import input_box, solved
from reference import equilibrium

from soilml import LinearWheel, Model, Operating, Wheel, soil
from soilml.numerics.root_finding import rising_root

SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))
CHANNELS = ("torque", "drawbar_pull", "sinkage")
GEARS = pytest.mark.parametrize("gear", [Wheel, LinearWheel])


def printed(gear):
    """The gear with shear stress of the sign of the slip."""
    return lambda **sizes: gear(**sizes, braking="slip-sign")


def at_slip(slip, gear=Wheel, count=256):
    return solved(input_box(count, seed=11) | {"slip": np.full(count, slip)}, gear=gear)


def largest_step(before, after, box):
    """Largest change of torque, pull and sinkage, in units of the row's own."""
    units = (box["load"] * box["radius"], box["load"], after.sinkage)
    both = (before.status == 0) & (after.status == 0)
    steps = [getattr(after, c) - getattr(before, c) for c in CHANNELS]
    return max(np.abs(s / u)[both].max() for s, u in zip(steps, units, strict=True))


@GEARS
def test_nothing_jumps_at_zero_slip_over_the_whole_box(gear):
    box, at_zero = input_box(256, seed=11), at_slip(0.0, gear)
    assert (at_zero.status == 0).sum() > 150
    for slip in (-1e-9, -1e-7):
        braking = at_slip(slip, gear)
        assert braking.status.tolist() == at_zero.status.tolist()
        assert largest_step(braking, at_zero, box) < 1e-7 + 2e3 * abs(slip)
    assert largest_step(at_slip(-1e-9, printed(gear)), at_zero, box) > 0.1


def test_a_wheel_rolls_freely_at_a_small_negative_slip_and_is_towed():
    loads = np.asarray([30.0, 60.0, 120.0])

    def torque(slip):
        return WHEEL(SAND, Operating(slip=slip, load=loads)).torque

    low, high = np.full(3, -0.3), np.zeros(3)
    assert (torque(low) < 0).all() and (torque(high) > 0).all()
    free = rising_root(torque, low, high, 0.5 * (low + high), np.ones(3))
    assert free.converged.all()
    assert ((free.x > -0.15) & (free.x < -0.01)).all()
    towed = WHEEL(SAND, Operating(slip=free.x, load=loads))
    assert np.abs(towed.torque / (loads * 0.15)).max() < 1e-6
    resistance = -towed.drawbar_pull / loads
    assert (resistance > 0.1).all() and (np.diff(resistance) > 0).all()  # deeper, harder to tow
    # shear drives the front of the rim and holds its rear
    shear = WHEEL.profile(SAND, Operating(slip=free.x, load=loads)).shear[1:]
    assert (np.diff(np.sign(shear), axis=0) != 0).sum(axis=0).tolist() == [1, 1, 1]
    assert (shear[0] > 0).all() and (shear[-1] < 0).all()


@GEARS
def test_driving_is_the_same_by_both_laws_to_the_last_bit(gear):
    box = input_box(256, seed=5)
    box["slip"] = np.abs(box["slip"])
    box["slip"][:16] = 0.0
    both = solved(box, gear=gear), solved(box, gear=printed(gear))
    for field in ("load", "entry_angle", "status", *CHANNELS):
        assert getattr(both[0], field).tobytes() == getattr(both[1], field).tobytes()


@GEARS
def test_the_printed_law_has_the_driving_formula_and_the_sign_of_the_slip(gear):
    wheel = gear(radius=0.15, width=0.12, braking="slip-sign")
    at = Operating(slip=np.asarray([-0.4, -0.05, 0.2]), load=60.0 * np.ones(3))
    arc = wheel.contact_geometry(np.asarray([0.02, 0.06, 0.03]), SAND, at)
    contact = wheel.contact(arc, at)
    passed = contact.surface_travel / 0.15
    rolled = np.sin(arc.entry) - np.sin(arc.entry - passed)
    expected = 0.15 * (passed - (1.0 - at.slip) * rolled)
    np.testing.assert_allclose(contact.shear_displacement, expected, rtol=1e-9, atol=1e-15)
    assert contact.shear_direction.tolist() == [-1.0, -1.0, 1.0]
    assert contact.travel_ratio.tolist() == (1.0 - at.slip).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("slip", [-0.93, -0.99, -0.999])
def test_a_nearly_locked_wheel_agrees_with_adaptive_quadrature(slip):
    box = input_box(128, seed=13) | {"slip": np.full(128, slip)}
    force = solved(box)
    rows = np.flatnonzero(force.status == 0)[::8]
    assert len(rows) > 8
    for i in rows:
        row = {name: values[i] for name, values in box.items()}
        _, pull, torque = equilibrium(row, near=force.entry_angle[i])
        assert force.torque[i] == pytest.approx(torque, rel=2e-6)
        assert force.drawbar_pull[i] == pytest.approx(pull, rel=2e-6)
