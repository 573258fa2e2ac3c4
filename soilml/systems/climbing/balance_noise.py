"""How far the balance of a climb may be off, by the noise of what was measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Real
from soilml.systems.climbing.climb import Climb, Uncertainty, WheelRun
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.wheel_force_parts import (
    Parts,
    parts,
    pull_of_rover,
    shared_magnification,
)
from soilml.systems.force_sensor_wheel import StressProfile

Floats = NDArray[np.float64]
#: Cohesion (Pa), friction angle (rad), shear modulus (m).
Shear = tuple[float, float, float]

#: Step of differences: share of the speed, rad of a slope or an entry angle.
STEP = 1e-3


def spread(
    rover: Rover, climb: Climb, shear: Shear, noise: Uncertainty
) -> tuple[float, float, float]:
    """(own, by_speed, by_entry): standard deviations of a climb's balance, N.

    `own` comes from the noise of speed, slope, stresses and the front's load in this run; the
    others from errors that all runs share, of the scale of the speed and of the entry angles. First
    order, at the soil `shear`: the effective variance of the balance. References: Orear, Am. J.
    Phys. 50(10), 1982.
    """
    cohesion, friction, modulus = shear
    tangent = np.tan(friction)

    def off(front: Parts, rear: Parts, slope: float = climb.slope) -> float:
        pull = pull_of_rover(rover, slope, (front, rear), cohesion, tangent)
        return float(pull - rover.weight * np.sin(slope))

    def of(wheel: WheelRun) -> Parts:
        return parts(wheel, rover, modulus)

    faster = climb.with_speed_error(STEP)
    front, rear = wheels = of(climb.front), of(climb.rear)
    here = off(front, rear)
    by_speed = (off(of(faster.front), of(faster.rear)) - here) / STEP
    earlier = of(_entering(climb.front, STEP)), of(_entering(climb.rear, STEP))
    by_entry = (off(earlier[0], earlier[1]) - here) / STEP
    own = (
        noise.speed * by_speed,
        noise.slope * (off(front, rear, climb.slope + STEP) - here) / STEP,
        *_by_load(rover, climb, wheels, shear, noise.front_load),
    )
    own_std = float(np.linalg.norm(own))
    return own_std, noise.speed_scale * by_speed, noise.entry_angle * by_entry


def _entering(wheel: WheelRun, further: float) -> WheelRun:
    """The wheel, meeting the soil this much (rad) further in front, with the same stress."""
    profile = wheel.profile
    kept = profile.angle < profile.entry_angle
    angle = np.append(profile.angle[kept], profile.entry_angle + further)
    normal = np.append(profile.normal[kept], 0.0)
    return WheelRun(wheel.slip, StressProfile(angle, normal))


def _by_load(
    rover: Rover, climb: Climb, wheels: tuple[Parts, Parts], shear: Shear, front_load: float
) -> list[float]:
    """N by load that stands on the other wheels, and by noise of the front's and rear's stress.

    More stress at one angle, at the same load, is less elsewhere: it counts by how far its grip
    differs from that of the stress which it takes the load from.
    """
    cohesion, friction, modulus = shear
    tangent = np.tan(friction)
    front, rear = wheels
    if rover.knows_loads:
        ratios = [_grip(front, tangent), _grip(rear, tangent)]
        each = [
            w.magnification(load, cohesion, tangent)
            for w, load in zip(wheels, rover.loads(climb.slope), strict=True)
        ]
    else:
        ratios = [_grip_together(wheels, tangent)] * 2
        each = [shared_magnification(rover, climb.slope, wheels, cohesion, tangent)] * 2
    on_front = front.load(each[0], cohesion, tangent)
    found = [2.0 * front_load * on_front * (_grip(front, tangent) - _grip(rear, tangent))]
    for wheel, magnification, ratio in zip(climb.wheels, each, ratios, strict=True):
        pull, lift = _per_stress(wheel, rover, tangent, modulus)
        noise = 2.0 * magnification * (pull - ratio * lift) * wheel.normal_std
        found.append(float(np.linalg.norm(noise)))
    return [float(value) for value in found]


def _grip(wheel: Parts, tangent: float) -> Real:
    """Pull over load of a wheel on soil without cohesion."""
    return _grip_together((wheel,), tangent)


def _grip_together(wheels: tuple[Parts, ...], tangent: float) -> Real:
    """Pull over load of wheels that share one magnification, on soil without cohesion."""
    pull = sum(w.pressure_pull + tangent * w.friction_pull for w in wheels)
    return pull / sum(w.pressure_lift + tangent * w.friction_lift for w in wheels)


def _per_stress(
    wheel: WheelRun, rover: Rover, tangent: float, modulus: float
) -> tuple[Floats, Floats]:
    """Pull and lift (N per Pa) of the stress at each sample, (p,); 0 outside the contact."""
    profile, angle = wheel.profile, wheel.profile.angle
    entry = profile.entry_angle
    turned = entry - angle - (1.0 - wheel.slip) * (np.sin(entry) - np.sin(angle))
    mobilised = -np.expm1(-rover.radius * np.abs(turned) / modulus)
    rubbed = np.where(wheel.slip < 0, -1.0, 1.0) * tangent * mobilised
    area = rover.radius * rover.width * np.gradient(angle)
    area = np.where((angle >= profile.exit_angle) & (angle <= entry), area, 0.0)
    pull = area * (rubbed * np.cos(angle) - np.sin(angle))
    lift = area * (rubbed * np.sin(angle) + np.cos(angle))
    return pull, lift
