"""Blind sets whose soil has another law, or changes from run to run."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.blind_sets import MECHANISMS, Plan, draw_blind_set
from datagen.blind_sets.law_families import (
    LAW_MECHANISMS,
    TREND_MECHANISMS,
    _curved_envelope,
    _elliptic,
    _firm_base,
    _hyperbolic_shear,
    _parabolic,
    _peak_and_decay,
    _saturating_pressure,
)
from datagen.blind_sets.reference_wheel import (
    ContactPoints,
    WheelState,
    ground_reaction,
    solve_equilibrium,
)
from soilml import EFFECTS

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


def points(j, normal=1e4):
    """Points with these shear displacements under one normal stress."""
    j = np.asarray(j, dtype=float)[:, None]
    rows = state()
    strength = np.full_like(j, 800.0 + normal * np.tan(0.55))
    shear = strength * -np.expm1(-j / 0.012)
    return rows, ContactPoints(j, j, j, j, np.full_like(j, normal), strength, shear)


def test_a_hyperbola_starts_as_steeply_and_mobilises_half_at_the_modulus():
    rows, at = points([1e-7, 0.012, 1.2])
    full = _hyperbolic_shear(at, None, rows, 1.0)
    assert full[0] / at.shear[0] == pytest.approx(1.0, rel=1e-4)
    assert full[1] == pytest.approx(0.5 * at.strength[1])
    assert full[2] == pytest.approx(at.strength[2], rel=0.02)
    half = _hyperbolic_shear(at, None, rows, 0.5)
    np.testing.assert_allclose(half, 0.5 * (full + at.shear))


def test_a_peak_is_the_strength_at_twice_the_modulus_and_decays():
    rows, at = points(np.linspace(0.0, 0.1, 101))
    full = _peak_and_decay(at, None, rows, 1.0)[:, 0]
    assert np.argmax(full) == 24 and full.max() == pytest.approx(at.strength[0, 0])
    assert full[100] < 0.2 * full.max() and full[0] == 0.0


def test_an_ellipse_and_a_parabola_reach_from_nothing_to_the_largest_stress():
    way, rows = np.linspace(0.0, 1.0, 5)[:, None], state()
    peak, line = np.array([2e4]), 2e4 * way
    ellipse = _elliptic(line, way, peak, rows, 1.0)[:, 0]
    parabola = _parabolic(line, way, peak, rows, 1.0)[:, 0]
    assert ellipse[[0, -1]] == pytest.approx([0.0, 2e4])
    assert parabola[[0, -1]] == pytest.approx([0.0, 2e4])
    assert (ellipse[1:-1] > parabola[1:-1]).all() and (parabola[1:-1] > line[1:-1, 0]).all()
    assert parabola[2] == pytest.approx(0.75 * 2e4)


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


def test_pressure_saturates_or_meets_a_base():
    rows, pressure = state(), np.array([[1.0], [2e4], [1e7]])
    soft = _saturating_pressure(pressure, pressure, rows, 5e-5)[:, 0]
    assert soft[0] == pytest.approx(1.0) and soft[1] == pytest.approx(2e4 * np.tanh(1.0))
    assert soft[2] == pytest.approx(2e4)
    np.testing.assert_array_equal(_saturating_pressure(pressure, pressure, rows, 0.0), pressure)
    depth = np.array([[0.0], [0.02], [0.0398]])
    firm = _firm_base(np.full((3, 1), 1e4), depth, rows, 25.0)[:, 0]
    assert firm[:2] == pytest.approx([1e4, 1e4 / 0.75]) and firm[2] > 50.0 * 1e4


def test_a_curved_envelope_turns_about_ten_kilopascal():
    rows, at = points([0.02], normal=1e4)
    np.testing.assert_allclose(_curved_envelope(at, None, rows, 0.1), at.shear)
    rows, at = points([0.02], normal=1e5)
    curved = _curved_envelope(at, None, rows, 0.1)
    strength = 800.0 + 1e5 * np.tan(0.45)
    assert curved[0, 0] == pytest.approx(at.shear[0, 0] * strength / at.strength[0, 0])


def test_every_law_is_an_effect_of_a_family_and_every_trend_is_one():
    assert {m.name for m in LAW_MECHANISMS} <= set(EFFECTS)
    assert all(EFFECTS[m.name].about.family for m in LAW_MECHANISMS)
    assert {m.name for m in TREND_MECHANISMS} == {"trend"}


@pytest.mark.parametrize("key", MECHANISMS["T"])
def test_a_trend_is_nothing_at_the_first_run_and_grows(key):
    cause = MECHANISMS["T"][key]
    rows = state(3, elapsed=[0.0, 0.5, 1.0])
    bare, changed = solve_equilibrium(rows), solve_equilibrium(rows, ((cause, cause.reference),))
    off = np.abs(changed.torque / bare.torque - 1.0) + np.abs(changed.sinkage / bare.sinkage - 1.0)
    assert off[0] == 0.0 and 0.003 < off[1] < off[2]


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


def test_times_are_recorded_in_every_other_set_of_laws_and_trends():
    timed = draw_blind_set(replace(PLAN, seed=8)).columns["time_s"]
    assert (np.diff(timed) > 0.0).all()
    assert "time_s" not in draw_blind_set(PLAN).columns
    law = replace(PLAN, tier="L", cause="firm-base/asymptote", seed=8)
    assert "time_s" in draw_blind_set(law).columns
