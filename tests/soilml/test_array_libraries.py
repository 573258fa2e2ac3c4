"""One source of physics runs on numpy, torch and a strict array library."""

import array_api_strict as strict
import numpy as np
import pytest
import torch

from soilml import Bulldozing, ExitAngle, Grousers, Model, Operating, SlipSinkage, Wheel, soil

MODEL = (
    Model(Wheel(radius=0.15, width=0.12))
    + SlipSinkage(n1=0.3)
    + Grousers(height=0.01)
    + ExitAngle(kappa=0.1)
    + Bulldozing(share=1.0)
)
SAND = soil("wong1989/dry_sand")
SLIP = np.concatenate([np.linspace(-0.5, 0.8, 9), [0.3]])
LOAD = np.concatenate([np.linspace(20.0, 150.0, 9), [1e5]])  # the last cannot be carried
FIELDS = ("torque", "drawbar_pull", "sinkage", "entry_angle")


@pytest.mark.parametrize("library", ["strict", "torch"])
def test_same_answers_in_another_array_library(library):
    make = strict.asarray if library == "strict" else torch.from_numpy
    expected = MODEL(SAND, Operating(slip=SLIP, load=LOAD))
    found = MODEL(SAND, Operating(slip=make(SLIP), load=make(LOAD)))
    assert type(found.torque) is type(make(SLIP))
    for name in FIELDS:
        values = np.asarray(getattr(found, name))
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-12, atol=1e-15)
    assert np.asarray(found.status).tolist() == expected.status.tolist()


def test_gradients_flow_through_the_equilibrium():
    from dataclasses import replace

    names = ("cohesion", "friction_angle", "shear_modulus", "kphi", "n")
    at = Operating(slip=torch.tensor([0.1, 0.3, 0.6], dtype=torch.float64), load=70.0)
    values = {
        name: torch.tensor(getattr(SAND, name), dtype=torch.float64, requires_grad=True)
        for name in names
    }
    plain = Model(Wheel(radius=0.15, width=0.12))
    force = plain(replace(SAND, **values), at)
    total = force.torque.sum() + 0.1 * force.drawbar_pull.sum() + 50.0 * force.sinkage.sum()
    total.backward()

    def value(**changes):
        f = plain(replace(SAND, **changes), Operating(slip=np.asarray([0.1, 0.3, 0.6]), load=70.0))
        return f.torque.sum() + 0.1 * f.drawbar_pull.sum() + 50.0 * f.sinkage.sum()

    for name in names:
        x = getattr(SAND, name)
        h = 1e-5 * x
        expected = (value(**{name: x + h}) - value(**{name: x - h})) / (2 * h)
        assert float(values[name].grad) == pytest.approx(expected, rel=1e-5)
