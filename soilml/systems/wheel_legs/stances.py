"""Stances of a wheel-leg as a rotating spring: stick-slip after midstance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.parameters import Parameter, check

Real = float | Floats

GRAVITY = 9.81
#: Steps per period of the lighter of foot and hub on the spring, for amplitudes accurate to 1 %.
STEPS_PER_PERIOD = 60


@final
@dataclass(frozen=True, kw_only=True)
class SpringLeg:
    """One leg of a wheel-leg as a spring between hub and foot; numbers, or arrays of one shape.

    Length, mass, speed and number of legs are those of Comin and Saaj 2017, table III; the mass of
    the foot, the lateral stiffness of the leg and its damping are not printed and are assumed.
    """

    stiffness: Annotated[Real, Parameter("N/m", 50.0, 1e6, "k_S, along the leg")]
    length: Annotated[Real, Parameter("m", 0.01, 5.0, "l_S, from hub to foot, unloaded")] = 0.1855
    hub_mass: Annotated[Real, Parameter("kg", 0.01, 1e4, "M_H")] = 3.75
    foot_mass: Annotated[Real, Parameter("kg", 1e-3, 1e3, "m_F")] = 0.25
    bending: Annotated[Real, Parameter("1", 0.0, 1.0, "stiffness across the leg over k_S")] = 0.3
    damping: Annotated[Real, Parameter("1", 0.0, 1.0, "of the hub on the leg, over critical")] = 0.1
    turning: Annotated[Real, Parameter("rad/s", 1e-3, 100.0, "omega, of the motor")] = 0.3
    legs: Annotated[Real, Parameter("1", 3.0, 12.0, "legs of the wheel-leg")] = 5.0
    softening: Annotated[Real, Parameter("m", 0.0, 1.0, "sliding over which friction drops")] = 0.0


@dataclass(frozen=True)
class StanceTrajectory:
    """A leg from midstance until the next leg takes over, arrays (times, ...)."""

    time: Floats  # s
    acceleration: Floats  # m/s^2, of the hub, upward
    foot_displacement: Floats  # m, rearward sliding of the foot
    normal: Floats  # N, on the ground


def simulate_stance(
    leg: SpringLeg, slip: Real, friction_angle: Real, increment: Real
) -> StanceTrajectory:
    r"""Simulate one stance from midstance at a constant slip; inputs broadcast to shape (...).

    .. math::
        F_S = k_S (l_S - L), \quad Q = \kappa k_S L (\omega t - \beta), \quad
        L^2 = z_H^2 + (x_H - x_C)^2, \quad \tan\beta = (x_H - x_C) / z_H

        M_H \ddot z_H = N - M_H g, \quad N = F_S \cos\beta - Q \sin\beta, \quad
        m_F \ddot x_C = \mu_D N - (F_S \sin\beta + Q \cos\beta)

    The foot sticks while F_E = F_S sin(beta) + Q cos(beta) <= N tan(phi_S) and slides against
    N tan(phi_D), phi_D = phi_S - `increment`, until it is at rest again (rad). With `softening` d
    the coefficient of friction decays to tan(phi_D) by exp(-s / d) over the distance s slid since
    the foot last broke loose. The source has d = 0. References: Comin
    and Saaj 2017, eqs. 20-23, in which Q is missing and the effect of slip is not printed. Here the
    hub advances by x_H = (1 - i) l sin(omega t), l the length under load (their eq. 11), while the
    motor turns the leg at omega: a sticking foot makes the leg lag and bends it by Q. Without
    Q no leg of a five-legged wheel-leg slips if phi_S > 36 degrees. The impact of the next leg is
    not included.
    """
    rows = list(_integrate(leg, slip, friction_angle, increment))
    return StanceTrajectory(*(np.stack(values) for values in zip(*rows, strict=True)))


def vibration_amplitude(
    leg: SpringLeg, slip: Real, friction_angle: Real, increment: Real
) -> Floats:
    r"""Delta a (m/s^2): the largest vertical acceleration of the hub during one stance.

    .. math:: \Delta a = \max_t |\ddot z_H + l_S \omega^2 \cos\omega t|

    without the acceleration of a rigid leg that does not slip. Inputs as `simulate_stance`.
    """
    largest = np.zeros(())
    for time, acceleration, _, _ in _integrate(leg, slip, friction_angle, increment):
        slow = leg.length * leg.turning**2 * np.cos(leg.turning * time)
        largest = np.maximum(largest, np.abs(acceleration + slow))
    return largest


def _integrate(
    leg: SpringLeg, slip: Real, friction_angle: Real, increment: Real
) -> Iterator[tuple[Floats, Floats, Floats, Floats]]:
    """(time, acceleration, foot displacement, normal force) per step: midpoint rule with events.

    A foot that comes to rest within a step stops there, and sticks or reverses at the next one.
    """
    check(leg)
    slip, static, gap, k, length, M, m, kappa, zeta, omega, legs, soften = (
        np.array(v, dtype=np.float64)
        for v in np.broadcast_arrays(
            slip, friction_angle, increment, leg.stiffness, leg.length, leg.hub_mass,
            leg.foot_mass, leg.bending, leg.damping, leg.turning, leg.legs, leg.softening,
        )
    )  # fmt: skip
    inside = (slip >= 0.0) & (slip <= 1.0) & (gap >= 0.0) & (static >= gap) & (static <= 1.4)
    if not inside.all():
        raise InputError(
            f"slip {slip[~inside][0]:g}, friction_angle {static[~inside][0]:g} and increment "
            f"{gap[~inside][0]:g} rad; needed are 0 <= slip <= 1, 0 <= increment <= friction <= 1.4"
        )
    mu_s, mu_d = np.tan(static), np.tan(static - gap)
    loaded_length, dashpot = length - M * GRAVITY / k, 2.0 * zeta * np.sqrt(k * M)
    if not (loaded_length > 0.5 * length).all():
        raise InputError(
            f"stiffness is {k.min():g} N/m: the leg is compressed by more than half its length; it "
            f"must be above {2.0 * (M * GRAVITY / length).max():g} N/m"
        )

    def forces(t: Floats, z: Floats, w: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Normal force, and the horizontal force on the foot."""
        angle = omega * t
        reach = (1.0 - slip) * loaded_length * np.sin(angle) - x
        rate = (1.0 - slip) * loaded_length * omega * np.cos(angle) - v
        span = np.hypot(z, reach)
        cos, sin = z / span, reach / span
        axial = np.maximum(k * (length - span) - dashpot * (w * cos + rate * sin), 0.0)
        across = kappa * k * span * (angle - np.arctan2(reach, z))
        return np.maximum(axial * cos - across * sin, 0.0), axial * sin + across * cos

    lasts, fastest = math.pi / legs / omega, np.sqrt(k / np.minimum(m, M))
    count = int(np.ceil(np.max(lasts * fastest) * STEPS_PER_PERIOD / (2.0 * math.pi)))
    dt = lasts / count
    half = 0.5 * dt
    z, w, x, v = loaded_length, np.zeros_like(k), np.zeros_like(k), np.zeros_like(k)
    heading = np.zeros_like(k)  # direction of sliding of the foot, 0 where it sticks
    slid = np.zeros_like(k)  # since it broke loose
    gradual = bool((soften > 0.0).any())
    decay = 1.0 / np.maximum(soften, 1e-9)  # of friction, 1/m; at once where nothing is given
    for step in range(count + 1):
        t = step * dt
        normal, push = forces(t, z, w, x, v)
        a = normal / M - GRAVITY
        yield t, a, -x, normal
        breaks = (heading == 0.0) & (np.abs(push) > mu_s * normal)
        heading = np.where(breaks, -np.sign(push), heading)
        slides = heading != 0.0
        slid = np.where(breaks, 0.0, slid)
        mu = mu_d + (mu_s - mu_d) * np.exp(-decay * slid) if gradual else mu_d
        c = np.where(slides, (-heading * mu * normal - push) / m, 0.0)
        normal, push = forces(t + half, z + half * w, w + half * a, x + half * v, v + half * c)
        a = normal / M - GRAVITY
        c = np.where(slides, (-heading * mu * normal - push) / m, 0.0)
        z, w = z + dt * (w + half * a), w + dt * a
        after = v + dt * c
        stops = slides & (after * heading <= 0.0) & (v * heading > 0.0)
        share = np.where(stops, v / np.where(stops, v - after, 1.0), 1.0)
        v, before = np.where(stops, 0.0, after), v
        moved = dt * share * 0.5 * (before + v)
        x, slid = x + moved, slid + np.abs(moved)
        heading = np.where(stops, 0.0, heading)
