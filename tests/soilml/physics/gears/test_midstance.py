"""The foot in midstance against adaptive quadrature, and what a foot must do."""

from itertools import pairwise

import array_api_strict as strict
import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import qmc

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import (
    EFFECTS,
    Midstance,
    Model,
    Operating,
    Soil,
    Status,
    identify,
    read_case,
    read_table,
    soil,
)
from soilml.cli import main
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.parameters import with_values
from soilml.physics.contact import integrate, stress
from soilml.quantities import column

FOOT = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
SAND = soil("comin2017/ssc-2", shear_modulus=0.0006)


def printed(theta1, slip, the_soil, foot=FOOT):
    """(F_V, T) at an entry angle: eqs. 12-17 as printed, one case after the other, by quad."""
    R, b, w = foot.radius, foot.width, foot.arc
    k, n, K = the_soil.kc / b + the_soil.kphi, the_soil.n, the_soil.shear_modulus
    tm = (the_soil.a0 + the_soil.a1 * slip) * theta1

    def tau(t, sigma):
        j = R * (theta1 - t - (1 - slip) * (np.sin(theta1) - np.sin(t)))
        strength = the_soil.cohesion + sigma * np.tan(the_soil.friction_angle)
        return np.copysign(1.0, slip) * strength * (1 - np.exp(-abs(j) / K))

    def front(t):
        return k * max(R * (np.cos(t) - np.cos(theta1)), 0.0) ** n

    def rear(t):
        return front(theta1 - t / tm * (theta1 - tm))

    def load(t, sigma):
        return (sigma * np.cos(t) + tau(t, sigma) * np.sin(t)) * R

    def torque(t, sigma):
        star = np.arctan(R * np.sin(t) / (foot.leg_length + foot.tip_height - R * (1 - np.cos(t))))
        radius = R * np.cos(t - star)
        radius += (foot.leg_length + foot.tip_height - R) * np.cos(star)
        turn = star - t
        return (sigma * np.sin(turn) + tau(t, sigma) * np.cos(turn)) * radius * R

    def integral(f, stress_at, low, high):
        layer = [high - x * K / R for x in (0.2, 1, 3, 10, 30)]
        flips = np.linspace(low, high, 2001)[1:-1] if slip < 0 else []
        js = [theta1 - t - (1 - slip) * (np.sin(theta1) - np.sin(t)) for t in flips]
        zero = [t for t, u, v in zip(flips[1:], js[:-1], js[1:], strict=True) if u * v < 0]
        layer += [z + x * K / R for z in zero for x in (-3, -1, 0, 1, 3)]
        ends = sorted({low, high, *(x for x in layer if low < x < high)})
        return sum(
            quad(lambda t: f(t, stress_at(t)), u, v, epsrel=1e-10, limit=300)[0]
            for u, v in pairwise(ends)
        )

    if w > theta1:  # low sinkage
        parts = [(front, tm, theta1), (rear, 0.0, tm)]
    elif w < tm:  # high
        parts = [(rear, 0.0, w)]
    else:
        parts = [(front, tm, w), (rear, 0.0, tm)]
    return tuple(b * sum(integral(f, *part) for part in parts) for f in (load, torque))


@pytest.mark.slow
@pytest.mark.parametrize("slip", [-0.3, 0.0, 0.125, 0.5])
@pytest.mark.parametrize("load", [2.0, 12.0, 20.0, 36.8, 45.0])
def test_rests_where_the_printed_integrals_carry_the_load(slip, load):
    force = Model(FOOT)(SAND, Operating(slip=slip, load=load))
    theta1 = brentq(lambda t: printed(t, slip, SAND)[0] - load, 1e-3, 1.5, xtol=1e-12)
    assert force.entry_angle == pytest.approx(theta1, rel=2e-4 if slip < 0 else 1e-5)
    assert force.torque == pytest.approx(printed(theta1, slip, SAND)[1], rel=5e-4)


def test_the_loads_above_stand_in_all_three_cases():
    force = Model(FOOT)(SAND, Operating(slip=0.125, load=np.asarray([2.0, 12.0, 45.0])))
    peak = (SAND.a0 + SAND.a1 * 0.125) * force.entry_angle
    assert force.entry_angle[0] < FOOT.arc
    assert peak[1] < FOOT.arc < force.entry_angle[1]
    assert FOOT.arc < peak[2]


@pytest.mark.parametrize("slip", [-0.2, 0.3])
def test_forces_and_their_slopes_run_on_from_case_to_case(slip):
    peak_share = SAND.a0 + SAND.a1 * slip
    for edge in (FOOT.arc, FOOT.arc / peak_share):
        entry = edge * (1.0 + np.asarray([-2e-6, -1e-6, 1e-6, 2e-6]))
        sinkage = FOOT.radius * (1 - np.cos(entry))
        at = Operating(slip=np.full(4, slip), load=np.ones(4))
        found = integrate(
            stress(FOOT.contact(FOOT.contact_geometry(sinkage, SAND, at), at), SAND, at)
        )
        for value in found:
            assert np.abs(np.diff(value)).max() < 1e-4 * abs(value[0])
            before, after = value[1] - value[0], value[3] - value[2]
            assert after == pytest.approx(before, rel=0.02)


def test_a_foot_whose_centre_is_the_hub_is_the_wheel_ahead_of_its_axle():
    from soilml import Wheel

    whole = Midstance(radius=0.15, width=0.1, arc=1.57, leg_length=0.15, tip_height=0.0)
    at = Operating(slip=np.linspace(0.05, 0.8, 7), load=60.0)
    ground = soil("wong1989/dry_sand")
    foot, wheel = Model(whole)(ground, at), Model(Wheel(radius=0.15, width=0.1))(ground, at)
    for channel in ("torque", "drawbar_pull", "sinkage"):
        np.testing.assert_allclose(getattr(foot, channel), getattr(wheel, channel), rtol=2e-5)


def test_the_torque_about_the_hub_is_that_about_the_arc_plus_the_pull_at_its_height():
    at = Operating(slip=np.linspace(0, 0.5, 5), load=12.0)
    force = Model(FOOT)(SAND, at)
    centred = Midstance(
        radius=FOOT.radius, width=FOOT.width, arc=FOOT.arc, leg_length=FOOT.radius, tip_height=0.0
    )
    raised = FOOT.leg_length + FOOT.tip_height - FOOT.radius
    np.testing.assert_allclose(
        force.torque, Model(centred)(SAND, at).torque + raised * force.drawbar_pull, rtol=1e-7
    )


def test_a_foot_has_the_length_and_rise_it_was_given():
    assert pytest.approx(0.04) == FOOT.radius * np.sin(FOOT.arc)
    assert pytest.approx(0.0055) == FOOT.radius * (1 - np.cos(FOOT.arc))


def test_softer_soil_sinks_more_and_a_longer_foot_less():
    at = Operating(slip=0.2, load=12.0)
    stiff = Model(FOOT)(SAND, at).sinkage
    assert Model(FOOT)(soil("comin2017/ssc-3"), at).sinkage > stiff
    longer = Midstance.of_foot(length=0.065, height=0.0055, width=0.029, leg_length=0.18)
    assert Model(longer)(SAND, at).sinkage < stiff


def test_a_load_that_the_foot_never_carries_is_flagged():
    force = Model(FOOT)(soil("comin2017/ssc-1"), Operating(slip=0.1, load=[10.0, 36.8]))
    assert list(force.status) == [Status.OK, Status.TOO_HEAVY]
    assert np.isnan(force.torque[1])


@pytest.mark.slow
def test_finite_over_a_box_of_feet_or_flagged_and_neutral_effects_change_nothing():
    u = qmc.Sobol(9, rng=3).random(256).T
    foot = Midstance.of_foot(0.02 + 0.06 * u[0], 0.003 + 0.01 * u[1], 0.02 + 0.06 * u[2], 0.18)
    ground = Soil(
        cohesion=3000 * u[3], friction_angle=0.4 + 0.4 * u[4], shear_modulus=10 ** (-3.3 + u[5]),
        kc=0.0, kphi=10 ** (5 + 1.5 * u[6]), n=0.4 + 0.8 * u[7],
    )  # fmt: skip
    at = Operating(
        slip=-0.5 + 1.3 * u[8], load=5 + 40 * u[0], speed=0.05, pass_number=2.0, slip_angle=0.1
    )
    plain = Model(foot)(ground, at)
    ok = plain.status == Status.OK
    assert ok.mean() > 0.5
    assert np.isfinite(plain.torque[ok]).all() and np.isnan(plain.torque[~ok]).all()
    for name, effect in EFFECTS.items():
        if effect.applies_to(foot):
            neutral = (Model(foot) + effect())(ground, at)
            np.testing.assert_allclose(neutral.torque, plain.torque, rtol=1e-7, err_msg=name)
        else:
            with pytest.raises(
                InputError, match="does not apply to the gear 'midstance'; it applies to: "
            ):
                Model(foot) + effect()


MODEL = """
[gear]
type = "midstance"
radius = 0.148205
width = 0.029
arc = 0.273289
leg_length = 0.18
tip_height = 0.0055
[soil]
name = "comin2017/ssc-2"
shear_modulus = 0.0006
[soil.prior]
friction_angle = [0.4, 0.9]
kphi = [1e5, 1e6]
[noise]
torque_Nm = "1 %"
sinkage_m = "1 %"
"""


def test_a_model_file_of_a_foot_identifies_its_soil(tmp_path):
    (tmp_path / "foot.toml").write_text(MODEL)
    case = read_case(tmp_path / "foot.toml")
    slip, load = np.tile(np.linspace(0.05, 0.5, 6), 2), np.repeat([8.0, 30.0], 6)
    truth = case.with_values({"friction_angle": 0.6, "kphi": 4e5})
    force = truth.model(truth.soil, Operating(slip=slip, load=load))
    columns = {"slip": slip, "load_N": load}
    columns |= {column(name): getattr(force, name) for name in ("torque", "sinkage")}
    fit = identify(case, Table(columns), method="nonlinear")
    assert fit["friction_angle"] == pytest.approx(0.6, rel=1e-3)
    assert fit["kphi"] == pytest.approx(4e5, rel=1e-3)
    with pytest.raises(InputError, match="take nonlinear"):
        identify(case, Table(columns), method="linear")


def test_a_model_file_of_a_foot_makes_synthetic_data(tmp_path):
    recipe = (
        "rows = 64\nseed = 1\n" + MODEL + "[operating]\nslip = [0.0, 0.5]\nload_N = [4.0, 40.0]\n"
    )
    (tmp_path / "recipe.toml").write_text(recipe)
    generate(read_recipe(tmp_path / "recipe.toml"), tmp_path / "foot.parquet")
    made = read_table(tmp_path / "foot.parquet")
    assert len(made) == 64
    assert (np.isfinite(made["torque_Nm"]) == made.answered).all()
    assert made.answered.mean() > 0.8 and (made["torque_Nm"][made.answered] > 0).mean() > 0.95


def test_a_foot_is_simulated_from_the_command_line(tmp_path):
    (tmp_path / "foot.toml").write_text(MODEL)
    out = tmp_path / "out.csv"
    driven = ["--slip", "0.1,0.3", "--load", "12,90", "--out", str(out)]
    assert main(["simulate", str(tmp_path / "foot.toml"), *driven]) == 0
    assert out.read_text().count(",ok") == 2


@pytest.mark.parametrize("make", [strict.asarray, torch.from_numpy])
def test_a_foot_gives_the_same_in_another_array_library(make):
    slip, load = np.asarray([-0.3, 0.0, 0.2, 0.5]), np.asarray([8.0, 20.0, 45.0, 300.0])
    expected = Model(FOOT)(SAND, Operating(slip=slip, load=load))
    found = Model(FOOT)(SAND, Operating(slip=make(slip), load=make(load)))
    for name in ("torque", "drawbar_pull", "sinkage", "status"):
        np.testing.assert_allclose(
            np.asarray(getattr(found, name)), getattr(expected, name), rtol=1e-12
        )


@pytest.mark.parametrize("name", ["friction_angle", "shear_modulus", "kphi", "n"])
def test_gradients_flow_through_the_foot(name):
    slip, load = np.asarray([0.05, 0.3]), np.asarray([5.0, 30.0])
    at = Operating(slip=torch.from_numpy(slip), load=torch.from_numpy(load))

    def value(x):
        force = Model(FOOT)(with_values(SAND, {name: x}), at)
        return force.torque.sum() + 50.0 * force.sinkage.sum()

    reference = float(getattr(SAND, name))
    x = torch.tensor(reference, dtype=torch.float64, requires_grad=True)
    value(x).backward()
    h = 1e-5 * reference
    expected = float(value(reference + h) - value(reference - h)) / (2 * h)
    assert float(x.grad) == pytest.approx(expected, rel=1e-4)
