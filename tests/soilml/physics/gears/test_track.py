"""The track against dense quadrature along the belt, and as sentences of physics."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import input_box

from soilml import EFFECTS, Model, Operating, Soil, Status, Track, Wheel, soil
from soilml import TrackGrousers as Grousers
from soilml.errors import InputError

GEAR = Track(radius=0.1, width=0.08, base=0.6)
TRACK = Model(GEAR)
SAND, CLAY = soil("wang2018/sand"), soil("wang2018/clay")
LOAD = 637.0
AT = Operating(slip=np.linspace(0.1, 0.9, 5), load=LOAD)
FIELDS = ("torque", "drawbar_pull", "sinkage", "entry_angle")
KNOWN = {"speed": 0.1, "pass_number": 2.0, "slip_angle": 0.15}


def walked(track, ground, slip, sinkage, count=100_001):
    """(W, DP, T) by walking back along the belt, which remembers how deep its soil has been."""
    r, b, L = track.radius, track.width, track.base
    entry = np.arccos(1.0 - sinkage / r)
    leave = track.leaving * entry
    psi = np.arcsin(track.settling * sinkage / L)
    meet = leave + 2.0 * psi
    x_c, y_c = -r * np.sin(leave), sinkage - r * (1.0 - np.cos(leave))
    across = L * np.cos(psi) - r * (np.sin(meet) + np.sin(leave))
    down = track.settling * sinkage + r * (np.cos(meet) - np.cos(leave))
    bend = 0.5 * np.hypot(across, down) / np.sin(0.5 * (leave + meet))  # eq. 3
    front = np.linspace(entry, -leave, count)
    arc = np.linspace(-leave, meet, count)
    back = np.linspace(meet, -track.rear_leaving * meet, count)
    depth = sinkage - r * (1.0 - np.cos(front))
    x_arc = x_c - bend * (np.sin(arc) + np.sin(leave))
    y_arc = y_c + bend * (np.cos(leave) - np.cos(arc))
    x_axle = x_arc[-1] - r * np.sin(meet)
    y_low = y_arc[-1] + r * (1.0 - np.cos(meet))
    np.testing.assert_allclose([-x_axle, y_low - sinkage], [L * np.cos(psi), L * np.sin(psi)])
    x = np.r_[r * np.sin(front), x_arc, x_axle + r * np.sin(back)]
    depth = np.r_[depth, y_arc, y_low - r * (1.0 - np.cos(back))]
    angle = np.r_[front, arc, back]
    way = np.r_[0.0, np.cumsum(np.hypot(np.diff(x), np.diff(depth)))]
    sheared = way - (1.0 - slip) * (x[0] - x)
    k = ground.kc / b + ground.kphi
    deepest = np.maximum.accumulate(np.maximum(depth, 0.0))
    peak = k * deepest**ground.n
    away = (deepest - depth) / (track.rebound * np.maximum(deepest, 1e-12))
    sigma = np.maximum(peak * (1.0 - away), 0.0)
    left = sigma / np.maximum(peak, 1e-9)
    sheared = np.where(left < 1.0, sheared * (1.0 - np.exp(-left / 0.05)), sheared)
    tau = ground.cohesion + sigma * np.tan(ground.friction_angle)
    tau = tau * (1.0 - np.exp(-np.abs(sheared) / ground.shear_modulus)) * np.where(slip < 0, -1, 1)

    def integral(f):
        return b * np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(way))

    sin, cos = np.sin(angle), np.cos(angle)
    return (
        integral(sigma * cos + tau * sin),
        integral(tau * cos - sigma * sin),
        r * integral(tau),
    )


SHAPES = {
    "usual": {},
    "taut": {"leaving": 0.005, "rebound": 1.0},
    "slack": {"leaving": 0.3, "rebound": 0.2},
    "level": {"settling": 0.0},
    "tail down": {"settling": 0.5, "rear_leaving": 0.3},
    "hard to unload": {"rebound": 0.03},
}


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("ground", [SAND, CLAY], ids=["sand", "clay"])
def test_agrees_with_a_dense_walk_along_the_belt(ground, shape):
    track = replace(GEAR, **SHAPES[shape])
    for load in (60.0, 637.0, 1500.0):
        at = Operating(slip=np.asarray([0.02, 0.3, 0.9]), load=load)
        force = Model(track)(ground, at)
        assert load > 60.0 or (force.status == Status.OK).all()
        for i, slip in enumerate(at.slip):
            if force.status[i] == Status.TOO_HEAVY:
                assert walked(track, ground, slip, float(track.largest_sinkage()))[0] < load
                continue
            carried, pull, torque = walked(track, ground, slip, float(force.sinkage[i]))
            assert carried == pytest.approx(load, rel=4e-5)
            assert force.torque[i] == pytest.approx(torque, rel=4e-5)
            assert force.drawbar_pull[i] == pytest.approx(pull, abs=4e-5 * load)


def test_a_braking_track_agrees_within_a_part_in_a_thousand():
    force = TRACK(SAND, Operating(slip=np.asarray([-0.6, -0.2, -0.03]), load=LOAD))
    for i, slip in enumerate((-0.6, -0.2, -0.03)):
        carried, pull, _ = walked(GEAR, SAND, slip, float(force.sinkage[i]))
        assert carried == pytest.approx(LOAD, rel=1e-3)
        assert force.drawbar_pull[i] == pytest.approx(pull, abs=1e-3 * LOAD)
    assert (force.drawbar_pull < 0).all()


def boxed(count, seed, effects=()):
    """Tracks, soils and driving that fill a wide box."""
    box = input_box(count, seed)
    names = ("cohesion", "friction_angle", "shear_modulus", "n", "kc", "kphi")
    u = np.random.default_rng(seed).random((5, count))
    radius = 0.04 * 5.0 ** u[0]
    gear = Track(
        radius=radius,
        width=box["width"],
        base=radius * (2.2 + 10.0 * u[1]),
        leaving=0.01 * 30.0 ** u[2],
        settling=0.5 * u[3],
        rebound=0.05 * 20.0 ** u[4],
    )
    at = Operating(slip=box["slip"], load=3.0 * box["load"], **KNOWN)
    return Model(gear, tuple(effects))(Soil(**{name: box[name] for name in names}), at), at


def test_every_row_of_a_wide_box_is_answered_or_too_heavy():
    force, at = boxed(512, seed=3)
    assert set(force.status) <= {Status.OK, Status.TOO_HEAVY}
    ok = force.status == Status.OK
    assert 0.5 < ok.mean() < 1.0
    np.testing.assert_allclose(force.load[ok], at.load[ok], rtol=1e-6)
    assert (force.load[~ok] < at.load[~ok]).all()
    for channel in FIELDS:
        np.testing.assert_array_equal(np.isfinite(getattr(force, channel)), ok)


def test_profile_follows_the_law_and_is_nothing_where_the_belt_does_not_touch():
    slack = Model(replace(GEAR, leaving=0.2, rebound=0.2))
    profile = slack.profile(SAND, Operating(slip=0.3, load=LOAD), points=2001)
    depth = float(slack(SAND, Operating(slip=0.3, load=LOAD)).sinkage)
    off = profile.normal <= 1e-3
    assert 0.1 < off.mean() < 0.9 and (np.abs(profile.shear[off]) < 1e-3).all()
    peak = SAND.kphi * depth**SAND.n
    assert profile.normal[:400].max() == pytest.approx(peak, rel=1e-4)
    rear = SAND.kphi * (1.2 * depth) ** SAND.n
    assert profile.normal[-400:].max() == pytest.approx(rear, rel=1e-3)


@pytest.mark.parametrize("slip", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("shape", ["usual", "slack", "tail down"])
def test_forces_of_the_profile_are_those_of_the_force(shape, slip):
    track = replace(GEAR, **SHAPES[shape])
    at, model = Operating(slip=slip, load=LOAD), Model(track)
    profile, force = model.profile(CLAY, at, points=20_001), model(CLAY, at)
    belt = track.contact_geometry(np.asarray(float(force.sinkage)), CLAY, at)
    length = track.radius * (belt.entry + belt.leave + belt.meet + belt.exit)
    length = length + belt.arc_radius * (belt.leave + belt.meet)
    along = np.linspace(0.0, float(length), 20_001)

    def total(density):
        return track.width * np.trapezoid(density, along)

    cos, sin = np.cos(profile.angle), np.sin(profile.angle)
    assert total(profile.normal * cos + profile.shear * sin) == pytest.approx(LOAD, rel=1e-4)
    pull = total(profile.shear * cos - profile.normal * sin)
    assert force.drawbar_pull == pytest.approx(pull, abs=1e-4 * LOAD)
    assert force.torque == pytest.approx(track.radius * total(profile.shear), rel=1e-4)


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="above twice the radius"):
        Track(radius=0.3, width=0.1, base=0.6)
    with pytest.raises(InputError, match=r"settling is 0\.8; it must lie between 0 and 0.5"):
        Model(replace(GEAR, settling=0.8))(SAND, AT)
    with pytest.raises(
        InputError, match="track-grousers does not apply to the gear 'wheel'; it applies to: track"
    ):
        Model(Wheel(radius=0.1, width=0.1)) + Grousers()
    with pytest.raises(
        InputError, match=r"exit-angle does not apply to .* it applies to: wheel, linear-wheel"
    ):
        TRACK + EFFECTS["exit-angle"]()
