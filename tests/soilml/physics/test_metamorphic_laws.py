"""Laws that hold whatever the numbers are: scales, mirrors, order, number of rows, precision."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from soilml import EFFECTS, LinearWheel, Model, Operating, Soil, Track, Wheel, soil

SAND = soil("wong1989/dry_sand")
CLAY = replace(SAND, cohesion=2000.0, friction_angle=0.45, kc=900.0, kphi=8e5, n=0.9)
GEARS = {
    "wheel": Wheel(radius=0.15, width=0.12),
    "linear_wheel": LinearWheel(radius=0.15, width=0.12),
    "track": Track(radius=0.1, width=0.12, base=0.6),
}
SLIP = np.linspace(-0.4, 0.8, 13)
LOAD = np.geomspace(20.0, 200.0, 13)
SPEED, PASSES, SIDE = 0.1, 2.0, 0.2
#: Effects without a length or force of their own among their constants. Slip sinkage has one, since
#: the units of k_c and k_phi depend on the exponent that it changes.
WITHOUT_SCALE = (
    *("bulldozing", "exit-angle", "lateral-slip", "multipass", "rate"),
    *("shear-softening", "sidewall-shear", "stress-shift"),
)
KNOWN = {"speed": SPEED, "pass_number": PASSES, "slip_angle": SIDE}
OUTPUTS = {"torque": (1, 1), "drawbar_pull": (0, 1), "sinkage": (1, 0), "entry_angle": (0, 0)}
cheap = settings(max_examples=5, deadline=None, derandomize=True)


def scaled_soil(earth: Soil, length: float, force: float) -> Soil:
    """The soil in a world of other lengths and forces: p = (k_c / b + k_phi) z^n."""
    stress = force / length**2
    return replace(
        earth,
        cohesion=earth.cohesion * stress,
        shear_modulus=earth.shear_modulus * length,
        kc=earth.kc * stress * length ** (1.0 - earth.n),
        kphi=earth.kphi * stress * length**-earth.n,
        unit_weight=earth.unit_weight * stress / length,
    )


def scaled_gear(gear, length: float):
    """The gear with other lengths."""
    lengths = {
        part.name: getattr(gear, part.name) * length
        for part in fields(gear)
        if part.name in ("radius", "width", "base")
    }
    return replace(gear, **lengths)


def answers(model, earth=SAND, slip=SLIP, load=LOAD, **known):
    force = model(earth, Operating(slip=slip, load=load, **known))
    return {name: np.asarray(getattr(force, name)) for name in OUTPUTS}


def with_effects(gear, names):
    model = Model(gear)
    for name in names:
        if EFFECTS[name].applies_to(gear):
            model = model + EFFECTS[name](**EFFECTS[name].about.reference)
    return model


@pytest.mark.parametrize("earth", [SAND, CLAY], ids=["sand", "clay"])
@pytest.mark.parametrize("effects", [(), WITHOUT_SCALE], ids=["bare", "effects"])
@pytest.mark.parametrize("name", GEARS)
@cheap
@given(length=st.floats(0.6, 1.6), stress=st.floats(0.3, 1.5))
def test_lengths_and_forces_have_no_scale(name, effects, earth, length, stress):
    force = stress * length**2
    model = with_effects(GEARS[name], effects)
    slip = SLIP if name != "track" else np.abs(SLIP)
    here = answers(model, earth, slip, **KNOWN)
    there = answers(
        replace(model, gear=scaled_gear(model.gear, length)),
        scaled_soil(earth, length, force),
        slip,
        LOAD * force,
        **KNOWN,
    )
    for quantity, (of_length, of_force) in OUTPUTS.items():
        expected = here[quantity] * length**of_length * force**of_force
        size = LOAD * force * (0.15 * length) if quantity == "torque" else LOAD * force
        floor = 1e-12 * (size if of_force else 0.0)
        error = np.abs(there[quantity] - expected)
        assert np.all(error <= 1e-12 * np.abs(expected) + floor), quantity


@pytest.mark.parametrize("gear", ["wheel", "linear_wheel"])
def test_travel_to_the_left_is_travel_to_the_right(gear):
    model = with_effects(GEARS[gear], ["lateral-slip"])
    left, right = (
        model(SAND, Operating(slip=SLIP, load=LOAD, slip_angle=angle)) for angle in (0.3, -0.3)
    )
    straight = model(SAND, Operating(slip=SLIP, load=LOAD, slip_angle=0.0))
    for quantity in OUTPUTS:
        np.testing.assert_array_equal(getattr(left, quantity), getattr(right, quantity))
    assert np.max(np.abs(left.torque - straight.torque)) > 1e-3


@pytest.mark.parametrize("name", GEARS)
@pytest.mark.parametrize("earth", [SAND, CLAY], ids=["sand", "clay"])
@cheap
@given(slip=st.floats(0.0, 0.9), more=st.floats(1.01, 3.0))
def test_more_load_or_softer_soil_sinks_more(name, earth, slip, more):
    model = Model(GEARS[name])
    here = answers(model, earth, np.full_like(LOAD, slip))["sinkage"]
    loaded = answers(model, earth, np.full_like(LOAD, slip), LOAD * more)["sinkage"]
    softer = replace(earth, kc=earth.kc / more, kphi=earth.kphi / more)
    soft = answers(model, softer, np.full_like(LOAD, slip))["sinkage"]
    assert np.all(loaded > here)
    assert np.all(soft > here)


@pytest.mark.parametrize("name", GEARS)
def test_stronger_soil_resists_more(name):
    model, slip = Model(GEARS[name]), np.abs(SLIP) + 0.02
    stronger = replace(SAND, cohesion=SAND.cohesion + 1000.0)
    assert np.all(answers(model, stronger, slip)["torque"] > answers(model, SAND, slip)["torque"])


@pytest.mark.parametrize("name", GEARS)
@cheap
@given(seed=st.integers(0, 2**31), parts=st.integers(1, 13))
def test_order_and_chunks_of_rows_do_not_matter(name, seed, parts):
    model = with_effects(GEARS[name], WITHOUT_SCALE)
    whole = answers(model, **KNOWN)
    order = np.random.default_rng(seed).permutation(SLIP.size)
    found = {quantity: np.empty_like(SLIP) for quantity in OUTPUTS}
    for rows in np.array_split(order, parts):
        part = answers(model, SAND, SLIP[rows], LOAD[rows], **KNOWN)
        for quantity, values in part.items():
            found[quantity][rows] = values
    for quantity, values in whole.items():
        np.testing.assert_allclose(found[quantity], values, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ["wheel", "linear_wheel"])
@pytest.mark.parametrize("library", [np.asarray, torch.asarray])
def test_single_precision_gives_the_same_answer_to_single_precision(name, library):
    model, slip = Model(GEARS[name]), np.abs(SLIP) + 0.05
    double = answers(model, SAND, slip)
    single = answers(
        model, SAND, library(slip.astype(np.float32)), library(LOAD.astype(np.float32))
    )
    for quantity in ("torque", "sinkage"):
        np.testing.assert_allclose(single[quantity], double[quantity], rtol=1e-5)
