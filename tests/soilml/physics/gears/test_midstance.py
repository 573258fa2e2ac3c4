"""The foot in midstance against adaptive quadrature, and what a foot must do."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import qmc

from soilml import (
    EFFECTS,
    Midstance,
    Model,
    Operating,
    Soil,
    Status,
    identify,
    read_case,
    soil,
)
from soilml.errors import InputError
from soilml.io.table import Table
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


@pytest.mark.parametrize("load", [2.0, 20.0, 45.0])  # low, medium and high sinkage
def test_forces_of_the_profile_are_those_of_the_force(load):
    at = Operating(slip=0.3, load=load)
    force, found = Model(FOOT)(SAND, at), Model(FOOT).profile(SAND, at, points=20_001)
    cos, sin = np.cos(found.angle), np.sin(found.angle)
    assert found.angle[0] == pytest.approx(min(float(force.entry_angle), FOOT.arc))
    for density, expected in (
        (found.normal * cos + found.shear * sin, load),
        (found.shear * cos - found.normal * sin, force.drawbar_pull),
    ):
        total = -np.trapezoid(density, found.angle) * FOOT.radius * FOOT.width
        assert total == pytest.approx(float(expected), rel=1e-4)


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
