"""The rigid wheel against adaptive quadrature, and as sentences of physics."""

from functools import partial

import numpy as np
import pytest
from conftest import input_box, solved
from reference import equilibrium, forces, row_of, stresses, turning_points

from soilml import ExitAngle, Model, Operating, Soil, Status, Wheel, soil

SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))
LAWS = ("displacement-sign", "slip-sign")


def check_by_quadrature(box, force, rows):
    """Entry angle, torque and pull of these rows by the reference."""
    for i in rows:
        row = {name: values[i] for name, values in box.items()}
        entry, pull, torque = equilibrium(row, near=force.entry_angle[i])
        assert force.entry_angle[i] == pytest.approx(entry, rel=1e-7)
        # the torque of a wheel that rolls freely is zero
        near_zero = 1e-9 * row["load"]
        assert force.torque[i] == pytest.approx(torque, rel=1e-6, abs=near_zero * row["radius"])
        assert force.drawbar_pull[i] == pytest.approx(pull, rel=1e-6, abs=near_zero)


@pytest.mark.slow
@pytest.mark.parametrize("law, braking", [(LAWS[0], False), (LAWS[0], True), (LAWS[1], True)])
def test_agrees_with_adaptive_quadrature_over_the_whole_input_box(law, braking):
    box = input_box(512, seed=20 + braking)
    box["slip"] = np.abs(box["slip"]) * (-1 if braking else 1)
    force = solved(box, gear=partial(Wheel, braking=law))
    rows = np.flatnonzero(force.status == 0)[:: 4 if braking else 3]
    assert len(rows) > 50
    check_by_quadrature(box | {"braking": np.full(512, law)}, force, rows)


@pytest.mark.slow
def test_agrees_at_the_corners_of_the_box():
    names = ("cohesion", "friction_angle", "shear_modulus", "n", "kphi", "slip", "load", "radius")
    ends = {
        "cohesion": (0.0, 6000.0),
        "friction_angle": np.deg2rad((15.0, 50.0)),
        "shear_modulus": (0.002, 0.06),
        "n": (0.4, 1.6),
        "kphi": (4e4, 1e7),
        "slip": (-0.9, 0.95),
        "load": (5.0, 1000.0),
        "radius": (0.04, 0.5),
    }
    corners = np.stack(np.meshgrid(*[[0, 1]] * 8), axis=-1).reshape(-1, 8)
    box = {n: np.asarray(ends[n])[corners[:, i]] for i, n in enumerate(names)}
    for name, value in {"width": 0.1, "kc": 0.0, "a0": 0.4, "a1": 0.15}.items():
        box[name] = np.full(len(corners), value)
    force = solved(box)
    rows = np.flatnonzero(force.status == 0)[::5]
    assert len(rows) > 25
    check_by_quadrature(box, force, rows)


def test_exit_angle_agrees_with_adaptive_quadrature():
    at = Operating(slip=0.25, load=80.0)
    force = (WHEEL + ExitAngle(kappa=0.2))(SAND, at)
    row = row_of(SAND, radius=0.15, width=0.12, slip=0.25, load=80.0)
    leave = -np.arccos(1.0 - 0.2 * force.sinkage / 0.15)
    load, pull, torque = forces(float(force.entry_angle), row, float(leave))
    assert load == pytest.approx(80.0, rel=1e-8)
    assert force.drawbar_pull == pytest.approx(pull, rel=1e-8)
    assert force.torque == pytest.approx(torque, rel=1e-8)


def test_rows_beyond_what_the_soil_carries_are_flagged_and_blank():
    box = input_box(512, seed=3)
    box["slip"] = np.abs(box["slip"])
    force = solved(box)
    heavy = np.flatnonzero(force.status == Status.TOO_HEAVY)
    assert len(heavy) > 20
    for i in heavy[::8]:
        row = {name: values[i] for name, values in box.items()}
        most, _, _ = forces(np.pi / 2, row)
        assert most < row["load"]
        assert force.load[i] == pytest.approx(most, rel=1e-6)
        assert np.isnan([force.torque[i], force.drawbar_pull[i], force.sinkage[i]]).all()
    # and none is flagged that the reference can carry
    for i in np.flatnonzero(force.status == 0)[::40]:
        row = {name: values[i] for name, values in box.items()}
        assert forces(np.pi / 2, row)[0] >= row["load"]


SHALLOW = [  # radius, width, c, phi, K, kc, kphi, n, slip, load; first rest, m
    (0.132, 0.2, 4740, 0.384, 0.0029, 283, 200700, 1.165, -0.0835, 10.59, 0.02372),
    (0.1881, 0.2425, 2458, 0.2759, 0.005924, 1142, 68130, 1.289, -0.2171, 10.25, 0.04573),
    (0.20922514, 0.38138873, 3038.31, 0.4060822, 0.00284310443, 30767.961, 61492.867, 1.51986868,
     -0.47842663, 21.615, 0.09319),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", SHALLOW)
def test_a_braking_wheel_rests_at_the_first_of_several_depths(case):
    radius, width, c, phi, K, kc, kphi, n, slip, load, first = case
    ground = Soil(cohesion=c, friction_angle=phi, shear_modulus=K, kc=kc, kphi=kphi, n=n)
    wheel = Model(Wheel(radius=radius, width=width, braking="slip-sign"))
    force = wheel(ground, Operating(slip=slip, load=load))
    assert force.status == Status.OK
    assert force.sinkage == pytest.approx(first, rel=5e-4)
    row = row_of(ground, radius=radius, width=width, slip=slip, braking="slip-sign")
    assert forces(float(force.entry_angle), row)[0] == pytest.approx(load, rel=1e-7)
    assert max(forces(t, row)[0] for t in np.linspace(0.1, 0.99, 20) * force.entry_angle) < load
    deeper = [forces(t, row)[0] for t in np.linspace(force.entry_angle, np.pi / 2, 30)]
    assert min(deeper) < load < deeper[-1]  # there is another further down


TWICE = [  # law; radius, width, c, phi, K, kc, kphi, n, slip, load, kappa
    ("slip-sign", 0.2649, 0.2286, 4552.0, 0.3675, 0.005238, 1094.0, 267500.0, 1.495, -0.0468,
     40.82, 0.793),
    ("slip-sign", 0.1669, 0.2375, 1653.7, 0.75319, 0.010844, 0.0, 326000.0, 1.289, -0.2662, 553.64,
     0.97),
    ("displacement-sign", 0.1077, 0.0908, 5247.0, 0.3227, 0.01326, 0.0, 382560.0, 1.268, -0.255,
     221.4, 0.95),
    ("displacement-sign", 0.0486, 0.0465, 4282.9, 0.7504, 0.00562, 0.0, 4313830.0, 0.8935, -0.1661,
     457.4, 0.95),
]  # fmt: skip


@pytest.mark.parametrize("case", TWICE)
def test_shear_that_turns_behind_the_axle_agrees_with_adaptive_quadrature(case):
    law, radius, width, c, phi, K, kc, kphi, n, slip, load, kappa = case
    ground = Soil(cohesion=c, friction_angle=phi, shear_modulus=K, kc=kc, kphi=kphi, n=n)
    model = Model(Wheel(radius=radius, width=width, braking=law)) + ExitAngle(kappa=kappa)
    force = model(ground, Operating(slip=slip, load=load))
    entry = float(force.entry_angle)
    leave = -float(np.arccos(1.0 - kappa * force.sinkage / radius))
    turns = [t for t in turning_points(entry, leave, slip, law) if entry - t > 1e-6]
    assert len(turns) == 2
    row = row_of(ground, radius=radius, width=width, slip=slip, braking=law)
    carried, pull, torque = forces(entry, row, leave)
    assert carried == pytest.approx(load, rel=1e-7)
    assert force.torque == pytest.approx(torque, rel=1e-7)
    assert abs(force.drawbar_pull - pull) < 1e-7 * load


def test_profile_of_stresses_follows_the_equations():
    profile = WHEEL.profile(SAND, Operating(slip=0.3, load=60.0), points=41)
    row = row_of(SAND, radius=0.15, width=0.12, slip=0.3)
    assert profile.angle.shape == (41,)
    for angle, normal, shear in zip(profile.angle, profile.normal, profile.shear, strict=True):
        sigma, tau = stresses(angle, profile.angle[0], 0.0, row)
        assert normal == pytest.approx(sigma, rel=1e-9, abs=1e-6)
        assert shear == pytest.approx(tau, rel=1e-9, abs=1e-6)
