"""One contract for every effect of the catalogue."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import input_box, solved

from soilml import EFFECTS, Model, Operating, Status, Wheel, soil
from soilml.effects.base import STAGES
from soilml.errors import InputError
from soilml.parameters import declared

SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))
AT = Operating(slip=np.linspace(0.15, 0.7, 8), load=60.0)
CHANNELS = ("torque", "drawbar_pull", "sinkage")

every = pytest.mark.parametrize("name", EFFECTS)


@every
def test_neutral_changes_nothing_to_the_last_bit(name):
    box = input_box(128, seed=4)
    plain, neutral = solved(box), solved(box, [EFFECTS[name]()])
    for field in ("load", "torque", "drawbar_pull", "sinkage", "entry_angle", "status"):
        np.testing.assert_array_equal(getattr(neutral, field), getattr(plain, field))


@every
def test_finite_over_the_whole_box_or_flagged(name):
    box = input_box(512, seed=8)
    for share in (0.5, 2.0):
        sized = {k: share * v for k, v in EFFECTS[name].about.reference.items()}
        force = solved(box, [EFFECTS[name](**sized)])
        ok = force.status == Status.OK
        assert ok.mean() > 0.3
        for channel in CHANNELS:
            assert np.isfinite(getattr(force, channel)[ok]).all()
            assert np.isnan(getattr(force, channel)[~ok]).all()
        np.testing.assert_allclose(force.load[ok], box["load"][ok], rtol=1e-6)


@every
def test_signs_are_as_declared(name):
    effect = EFFECTS[name](**EFFECTS[name].about.reference)
    plain, changed = WHEEL(SAND, AT), (WHEEL + effect)(SAND, AT)
    assert effect.about.signs
    for channel, sign in effect.about.signs.items():
        assert (sign * (getattr(changed, channel) - getattr(plain, channel)) > 0).all()


@every
def test_answers_change_smoothly_with_the_size(name):
    cls = EFFECTS[name]

    def at_size(share):
        effect = cls(**{k: share * v for k, v in cls.about.reference.items()})
        force = (WHEEL + effect)(SAND, AT)
        return np.stack([getattr(force, c) for c in CHANNELS])

    h = 1e-4
    coarse = (at_size(1 + 10 * h) - at_size(1 - 10 * h)) / (20 * h)
    fine = (at_size(1 + h) - at_size(1 - h)) / (2 * h)
    scale = np.abs(fine).max(axis=1, keepdims=True) + 1e-12
    assert np.abs((coarse - fine) / scale).max() < 1e-4


@every
def test_is_described(name):
    cls = EFFECTS[name]
    assert cls.name == name
    assert any(hasattr(cls, stage) for stage in STAGES)
    assert cls.about.text and cls.about.source and "References:" in cls.__doc__
    assert set(cls.about.reference) <= set(declared(cls))


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


def test_lugs_move_the_shearing_radius():
    lugged = (WHEEL + EFFECTS["grousers"](height=0.01, shearing=0.5))(SAND, AT)
    profile = (WHEEL + EFFECTS["grousers"](height=0.01, shearing=0.5)).profile(SAND, AT, 4001)
    # by hand: r b times the integral of the shear stress, at the lever arm r + h / 2
    arc = -np.trapezoid(profile.shear, profile.angle, axis=0) * 0.15 * 0.12
    np.testing.assert_allclose(lugged.torque, arc * 0.155, rtol=1e-4)


def test_an_effect_can_stand_in_a_model_once():
    with pytest.raises(InputError, match="already"):
        _ = WHEEL + EFFECTS["slip-sinkage"]() + EFFECTS["slip-sinkage"]()


def test_a_users_own_effect_takes_part():
    class DeeperRut:
        name = "deeper-rut"

        def on_reading(self, force, scene):
            return replace(force, sinkage=force.sinkage + 0.001)

    force = (WHEEL + DeeperRut())(SAND, AT)
    np.testing.assert_allclose(force.sinkage, WHEEL(SAND, AT).sinkage + 0.001, rtol=1e-12)
