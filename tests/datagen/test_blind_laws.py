"""Blind sets whose soil has another law, or changes from run to run."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.blind_sets import MECHANISMS, Plan, draw_blind_set
from datagen.blind_sets.law_families import (
    LAW_MECHANISMS,
)
from datagen.blind_sets.reference_wheel import (
    WheelState,
    ground_reaction,
)

PLAN = Plan("T", "trend/friction", 1.0, 0.01, 8, "dry-sand", 3, seed=7)
VALUES = {
    "slip": 0.3,
    "load": 80.0,
    "radius": 0.15,
    "width": 0.12,
    "cohesion": 800.0,
    "friction_angle": 0.55,
    "shear_modulus": 0.012,
    "kc": 990.0,
    "kphi": 1.2e6,
    "n": 1.0,
    "a0": 0.4,
    "a1": 0.15,
    "unit_weight": 15000.0,
    "speed": 0.05,
    "pass_number": 1.0,
    "slip_angle": 0.0,
}


def state(count=1, **changed):
    values = {name: np.full(count, v) for name, v in VALUES.items()}
    return WheelState(**(values | {name: np.asarray(v) for name, v in changed.items()}))


def test_the_shape_acts_on_both_halves_of_the_contact_with_its_largest_stress():
    """With n = 1 and the ellipse, the load of the normal stress is that of a direct sum."""
    rows = state(cohesion=[0.0], friction_angle=[0.0], kc=[0.0])
    cause = next(m for m in LAW_MECHANISMS if m.name == "elliptic-pressure")
    entry = np.array([0.5])
    load = ground_reaction(entry, rows, ((cause, 1.0),)).load[0]
    peak = (0.4 + 0.15 * 0.3) * 0.5
    theta = np.linspace(0.0, 0.5, 200_001)
    way = np.where(theta > peak, (0.5 - theta) / (0.5 - peak), theta / peak)
    largest = 1.2e6 * 0.15 * (np.cos(peak) - np.cos(0.5))
    normal = largest * np.sqrt(1.0 - (1.0 - way) ** 2)
    assert load == pytest.approx(
        0.15 * 0.12 * np.trapezoid(normal * np.cos(theta), theta), rel=1e-4
    )


@pytest.mark.slow
def test_a_soil_that_changes_does_so_in_the_order_of_the_runs():
    for key in MECHANISMS["T"]:
        drawn = draw_blind_set(replace(PLAN, cause=key))
        assert [c["name"] for c in drawn.truth["causes"]] == ["trend"]
        runs = np.unique(drawn.columns["run"], return_inverse=True)[1]
        first = runs == 0
        for name, values in drawn.truth["runs_true"].items():
            change = np.array(values) - np.array(drawn.truth["runs_without"][name])
            assert not change[first].any()
            if change.any():
                assert np.abs(change[runs == 7]).max() > 0.0
        assert set(drawn.truth["region_elapsed"]) == {1.0}
