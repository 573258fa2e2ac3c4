"""Blind sets whose soil has another law, or changes from run to run."""

import numpy as np
import pytest

from datagen.blind_sets.law_families import (
    LAW_MECHANISMS,
)
from datagen.blind_sets.reference_wheel import (
    WheelState,
    ground_reaction,
)

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
