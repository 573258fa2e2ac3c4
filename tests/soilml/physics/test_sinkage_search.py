"""The searches for the sinkage agree, do little work, and say why a row has no answer."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import input_box

from soilml import EFFECTS, Operating, Soil, Status, Wheel, soil
from soilml.physics import sinkage_search
from soilml.physics.contact import Resolution
from soilml.physics.equilibrium import sensor_readings
from soilml.physics.forces import load_at_sinkage
from soilml.physics.load_case import LoadCase
from soilml.physics.model import flattened, in_chunks

SAND = soil("wong1989/dry_sand")
WHEEL = Wheel(radius=0.15, width=0.12)


def batch(slip, load, ground=SAND, gear=WHEEL, effects=()):
    slip, load = np.broadcast_arrays(np.asarray(slip, float), np.asarray(load, float))
    return flattened(LoadCase(gear, ground, Operating(slip=slip, load=load), effects))[0]


@pytest.mark.parametrize("slip", [-0.6, -0.95])
def test_a_row_that_nothing_carries_states_the_largest_load(slip):
    ground = replace(SAND, shear_modulus=0.002, cohesion=500.0, friction_angle=0.7)
    every = np.geomspace(1e-6, 0.15, 4000)
    carried = load_at_sinkage(batch(slip + 0.0 * every, 60.0, ground), every)
    most = float(carried.max())
    loads = most * np.asarray([1.002, 1.5, 20.0])
    found = sinkage_search.first_equilibrium(batch(np.full(3, slip), loads, ground))
    assert (found.status == Status.TOO_HEAVY).all()
    np.testing.assert_allclose(found.load, most, rtol=1e-3)
    below = sinkage_search.first_equilibrium(
        batch(np.full(2, slip), [0.3 * most, 0.99 * most], ground)
    )
    assert not below.status.any()
    # no smaller sinkage carries these loads
    for sinkage, load in zip(below.sinkage, (0.3 * most, 0.99 * most), strict=True):
        first = every[np.argmax(carried >= load)]
        assert sinkage == pytest.approx(first, rel=5e-3)


@pytest.mark.parametrize("effects", [(), ("flat-rim",)], ids=["rigid", "flat"])
@pytest.mark.parametrize("braking", [False, True])
def test_forces_in_fits_differ_from_those_at_full_resolution_by_far_less_than_noise(
    braking, effects
):
    box = input_box(4096, seed=5)
    load, radius = box["load"], box["radius"]
    slip = -np.abs(box["slip"]) if braking else np.abs(box["slip"])
    names = ("cohesion", "friction_angle", "shear_modulus", "n", "kc", "kphi", "a0", "a1")
    case = LoadCase(
        Wheel(radius=radius, width=box["width"]),
        Soil(**{name: box[name] for name in names}),
        Operating(slip=slip, load=load),
        tuple(EFFECTS[name](compliance=4e-5) for name in effects),
    )
    with np.errstate(all="ignore"):  # rows without an answer are flagged
        full, fit = (
            in_chunks(flattened(replace(case, resolution=own))[0], sensor_readings)
            for own in (Resolution.FULL, Resolution.FIT)
        )
    both = (full.status == 0) & (fit.status == 0)
    assert np.mean(both == (full.status == 0)) > 0.999
    scales = {"torque": load * radius, "drawbar_pull": load, "sinkage": full.sinkage}
    for name, scale in scales.items():
        off = (np.abs(getattr(fit, name) - getattr(full, name)) / scale)[both]
        assert np.quantile(off, 0.99) < 1e-4
        assert off.max() < (2e-2 if braking else 1e-3)
