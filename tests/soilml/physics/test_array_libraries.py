"""One source of physics runs on numpy, torch and a strict array library."""

from dataclasses import replace

import array_api_strict as strict
import numpy as np
import pytest
import torch

from soilml import (
    EFFECTS,
    LinearWheel,
    Midstance,
    Model,
    Operating,
    Track,
    TrackGrousers,
    Wheel,
    soil,
)

pytestmark = pytest.mark.slow

WHEEL = Model(Wheel(radius=0.15, width=0.12))
OF_WHEELS = {name: cls for name, cls in EFFECTS.items() if cls.applies_to(WHEEL.gear)}
FOOT = Model(Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18))
TRACK = Model(Track(radius=0.1, width=0.08, base=0.6))
CASES = {
    "all": replace(WHEEL, effects=tuple(cls(**cls.about.reference) for cls in OF_WHEELS.values())),
    "none": WHEEL,
    "track": TRACK,
    "track with grousers": TRACK + TrackGrousers(spacing=0.7),
    "foot": FOOT,
}
SAND = soil("wong1989/dry_sand")
SLIP = np.concatenate([np.linspace(-0.5, 0.8, 9), [0.3]])
LOAD = np.concatenate([np.linspace(20.0, 150.0, 9), [1e5]])  # the last cannot be carried
FIELDS = ("torque", "drawbar_pull", "sinkage", "entry_angle")


KNOWN = {
    "speed": np.linspace(-0.1, 0.3, 10),
    "pass_number": np.arange(10.0) % 3 + 1.0,
    "slip_angle": np.linspace(-0.3, 0.3, 10),
    "progress": np.linspace(0.0, 1.0, 10),
    "load_direction": np.arange(10.0) % 3 - 1.0,
}


@pytest.mark.parametrize("library", ["strict", "torch"])
@pytest.mark.parametrize("case", CASES)
def test_same_answers_in_another_array_library(library, case):
    make = strict.asarray if library == "strict" else torch.from_numpy
    given = {"slip": SLIP, "load": LOAD, **KNOWN}
    expected = CASES[case](SAND, Operating(**given))
    found = CASES[case](SAND, Operating(**{name: make(value) for name, value in given.items()}))
    assert type(found.torque) is type(make(SLIP))
    for name in FIELDS:
        values = np.asarray(getattr(found, name))
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-12, atol=1e-15)
    assert np.asarray(found.status).tolist() == expected.status.tolist()


@pytest.mark.parametrize("gear", [Wheel, LinearWheel])
def test_gradients_flow_through_the_size_of_every_effect(gear, subtests):
    bare = Model(gear(radius=0.15, width=0.12))
    slip = np.asarray([-0.4, -0.02, 0.2, 0.3, 0.6])
    known = {"speed": 0.1, "pass_number": 2.0, "slip_angle": 0.2, "load_direction": 1.0}

    def value(effect, x):
        at = Operating(slip=torch.from_numpy(slip) if torch.is_tensor(x) else slip, load=70.0)
        f = (bare + effect(**{effect.about.size: x}))(SAND, replace(at, **known))
        return f.torque.sum() + 0.1 * f.drawbar_pull.sum() + 50.0 * f.sinkage.sum()

    for name, effect in OF_WHEELS.items():
        if not effect.applies_to(bare.gear):
            continue
        with subtests.test(name):
            reference = 0.7 * effect.about.reference[effect.about.size]
            x = torch.tensor(reference, dtype=torch.float64, requires_grad=True)
            value(effect, x).backward()
            h = 1e-4 * reference
            expected = (value(effect, reference + h) - value(effect, reference - h)) / (2 * h)
            assert float(x.grad) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("model", "load"), [(WHEEL, 70.0), (CASES["track with grousers"], 637.0), (FOOT, 5.0)]
)
def test_gradients_flow_through_the_equilibrium(model, load):
    names = ("cohesion", "friction_angle", "shear_modulus", "kphi", "n")
    slip = np.asarray([-0.6, -0.05, 0.1, 0.3, 0.6])
    at = Operating(slip=torch.from_numpy(slip), load=load)
    values = {
        name: torch.tensor(getattr(SAND, name), dtype=torch.float64, requires_grad=True)
        for name in names
    }
    force = model(replace(SAND, **values), at)
    total = force.torque.sum() + 0.1 * force.drawbar_pull.sum() + 50.0 * force.sinkage.sum()
    total.backward()

    def value(**changes):
        f = model(replace(SAND, **changes), Operating(slip=slip, load=load))
        return f.torque.sum() + 0.1 * f.drawbar_pull.sum() + 50.0 * f.sinkage.sum()

    for name in names:
        x = getattr(SAND, name)
        h = 1e-5 * x
        expected = (value(**{name: x + h}) - value(**{name: x - h})) / (2 * h)
        assert float(values[name].grad) == pytest.approx(expected, rel=1e-5)
