"""Standard deviation of the force balance of a climb, from the noise of the measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array
from soilml.systems.climbing.climb import Climb, Rover, Uncertainty, WheelRun
from soilml.systems.climbing.wheel_force_components import (
    ForceComponents,
    force_components,
    pull_of_rover,
    shared_magnification,
)
from soilml.systems.force_sensor_wheel import StressProfile

Floats = NDArray[np.float64]
#: Cohesion (Pa), friction angle (rad), shear modulus (m).
ShearParameters = tuple[float, float, float]

#: Step of forward differences: fraction of the speed, rad of a slope or of an entry angle. Well
#: below the usual standard deviations of these quantities.
STEP = 1e-3


def balance_std(
    rover: Rover, climb: Climb, shear: ShearParameters, noise: Uncertainty
) -> tuple[float, float, float]:
    """Standard deviations of a climb's balance, N: (independent, by speed scale, by entry angle).

    The first combines speed, slope, stress and front load of this run alone; the others come from
    errors that all runs share, of the speed scale and of the entry angles. First order at the soil
    `shear`: the effective variance of the balance. References: Orear, Am. J. Phys. 50(10), 1982.
    """
    cohesion, friction, modulus = shear
    tan_friction = np.tan(friction)

    def residual(
        front: ForceComponents, rear: ForceComponents, slope: float = climb.slope
    ) -> float:
        pull = pull_of_rover(rover, slope, (front, rear), cohesion, tan_friction)
        return float(pull - rover.weight * np.sin(slope))

    def components(wheel: WheelRun) -> ForceComponents:
        return force_components(wheel, rover, modulus)

    front, rear = wheels = components(climb.front), components(climb.rear)
    reference = residual(front, rear)
    faster = climb.with_speed_error(STEP)
    by_speed = (residual(components(faster.front), components(faster.rear)) - reference) / STEP
    earlier = components(_with_entry(climb.front, STEP)), components(_with_entry(climb.rear, STEP))
    by_entry = (residual(earlier[0], earlier[1]) - reference) / STEP
    independent = (
        noise.speed * by_speed,
        noise.slope * (residual(front, rear, climb.slope + STEP) - reference) / STEP,
        *_load_and_stress_terms(rover, climb, wheels, shear, noise.front_load),
    )
    independent_std = float(np.linalg.norm(independent))
    return independent_std, noise.speed_scale * by_speed, noise.entry_angle * by_entry


def _with_entry(wheel: WheelRun, shift: float) -> WheelRun:
    """The wheel with its entry angle moved forward by `shift` (rad), the stress unchanged."""
    profile = wheel.profile
    kept = profile.angle < profile.entry_angle
    angle = np.append(profile.angle[kept], profile.entry_angle + shift)
    normal = np.append(profile.normal[kept], 0.0)
    return WheelRun(wheel.slip, StressProfile(angle, normal))


def _load_and_stress_terms(
    rover: Rover,
    climb: Climb,
    wheels: tuple[ForceComponents, ForceComponents],
    shear: ShearParameters,
    front_load: float,
) -> list[float]:
    """N by load moved between the axles, and by noise of the front's and the rear's stress.

    At a given load, more stress at one angle means less elsewhere: it counts by the difference
    between its ratio of pull to load and that of the whole profile.
    """
    cohesion, friction, modulus = shear
    tan_friction = np.tan(friction)
    front, rear = wheels
    if rover.has_known_loads:
        ratios = [_pull_ratio((front,), tan_friction), _pull_ratio((rear,), tan_friction)]
        magnifications = [
            w.magnification(load, cohesion, tan_friction)
            for w, load in zip(wheels, rover.loads(climb.slope), strict=True)
        ]
    else:
        ratios = [_pull_ratio(wheels, tan_friction)] * 2
        magnifications = [
            shared_magnification(rover, climb.slope, wheels, cohesion, tan_friction)
        ] * 2
    load_on_front = front.load(magnifications[0], cohesion, tan_friction)
    ratio_difference = _pull_ratio((front,), tan_friction) - _pull_ratio((rear,), tan_friction)
    terms = [2.0 * front_load * load_on_front * ratio_difference]
    for wheel, magnification, ratio in zip(climb.wheels, magnifications, ratios, strict=True):
        pull, lift = _per_stress(wheel, rover, tan_friction, modulus)
        by_stress = 2.0 * magnification * (pull - ratio * lift) * wheel.normal_std
        terms.append(float(np.linalg.norm(by_stress)))
    return [float(value) for value in terms]


def _pull_ratio(wheels: tuple[ForceComponents, ...], tan_friction: float) -> Array:
    """Pull over load of wheels with one magnification, on soil without cohesion."""
    pull = sum(w.pressure_pull + tan_friction * w.friction_pull for w in wheels)
    return pull / sum(w.pressure_lift + tan_friction * w.friction_lift for w in wheels)


def _per_stress(
    wheel: WheelRun, rover: Rover, tan_friction: float, modulus: float
) -> tuple[Floats, Floats]:
    """Pull and lift per unit stress at each sample (N per Pa), (p,); 0 outside the contact."""
    profile, angle = wheel.profile, wheel.profile.angle
    entry = profile.entry_angle
    shear_angle = entry - angle - (1.0 - wheel.slip) * (np.sin(entry) - np.sin(angle))
    mobilised = -np.expm1(-rover.radius * np.abs(shear_angle) / modulus)
    friction = np.where(wheel.slip < 0, -1.0, 1.0) * tan_friction * mobilised
    area = rover.radius * rover.width * np.gradient(angle)
    area = np.where((angle >= profile.exit_angle) & (angle <= entry), area, 0.0)
    pull = area * (friction * np.cos(angle) - np.sin(angle))
    lift = area * (friction * np.sin(angle) + np.cos(angle))
    return pull, lift
