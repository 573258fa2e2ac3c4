"""Force balances of climbs: residuals, their covariance, and the shear modulus of each climb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Array, Floats
from soilml.numerics.prior import Prior
from soilml.systems.climbing.climb import Climb, Rover, ShearParameters, Uncertainty, WheelRun
from soilml.systems.climbing.wheel_force_components import (
    ForceComponents,
    force_components,
    pull_of_rover,
    shared_magnification,
    stack_components,
)
from soilml.systems.force_sensor_wheel import StressProfile

#: Values of k_x, evenly spaced in the logarithm, between which forces are interpolated linearly.
KNOTS = 256
MARGIN = 1e-6  # Extension of the table of ln k_x beyond both ends of the prior, against rounding
#: Lower limit of the standard deviation of a balance, as a fraction of the weight.
MIN_STD_FRACTION = 1e-4


@dataclass(frozen=True)
class ForceBalances:
    """The climbs of one rover, with wheel forces tabulated over the range of k_x."""

    rover: Rover
    climbs: tuple[Climb, ...]
    log_modulus: Floats  # (KNOTS,)
    wheels: tuple[ForceComponents, ForceComponents]  # front and rear, each (climbs, KNOTS)

    @classmethod
    def tabulate(cls, rover: Rover, climbs: Sequence[Climb], modulus: Prior) -> ForceBalances:
        """Tabulate the wheel forces between the ends of the prior of k_x (m)."""
        knots = np.linspace(np.log(modulus.lower) - MARGIN, np.log(modulus.upper) + MARGIN, KNOTS)
        front = stack_components([force_components(c.front, rover, np.exp(knots)) for c in climbs])
        rear = stack_components([force_components(c.rear, rover, np.exp(knots)) for c in climbs])
        return cls(rover, tuple(climbs), knots, (front, rear))

    def residuals(self, soils: Floats) -> Floats:
        """Pull less the weight's component along the slope, N (n, climbs).

        `soils` (n, 3) are cohesion (Pa), friction angle (rad) and shear modulus (m).
        """
        cohesion, friction, modulus = soils.T
        position = np.interp(np.log(modulus), self.log_modulus, np.arange(len(self.log_modulus)))
        knot = np.minimum(position.astype(int), len(self.log_modulus) - 2)
        front, rear = (wheel.interpolated(knot, position - knot) for wheel in self.wheels)
        slope = np.asarray([climb.slope for climb in self.climbs])[:, None]
        pull = pull_of_rover(self.rover, slope, (front, rear), cohesion, np.tan(friction))
        return np.asarray(pull - self.rover.weight * np.sin(slope)).T

    def whitener(self, shear: ShearParameters, noise: Uncertainty) -> tuple[Floats, Floats]:
        """Whitening matrix and standard deviations of the residuals at one soil.

        Returns (L, std): L @ residuals has unit covariance, L (climbs, climbs); std (climbs,), N.
        """
        stds = np.asarray([balance_std(self.rover, c, shear, noise) for c in self.climbs])
        independent, shared = stds[:, 0], stds[:, 1:]
        lower_limit = MIN_STD_FRACTION * self.rover.weight
        covariance = np.diag(independent**2 + lower_limit**2) + shared @ shared.T
        return np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(np.diag(covariance))


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


#: Range in which k_x is searched, m, and points of the search grid, evenly spaced in ln k_x.
RANGE = Prior(1e-4, 0.2, log=True)
GRID_SIZE = 2001


def modulus_per_climb(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    cohesion: float,
    friction_angle: float,
    speed_error: float = 0.0,
) -> Floats:
    """k_x (m) at which the forces of each climb balance (climbs,).

    NaN if none from 0.1 to 200 mm does. With `speed_error` the climbs are evaluated as if the
    speeds had been measured too high by this fraction. The pull of a driving wheel decreases with
    k_x, so that there is at most one solution. References: Nagatani et al., section 6.2, Figs. 8
    and 9.
    """
    assumed = [climb.with_speed_error(speed_error) for climb in climbs]
    modulus = RANGE.at(np.linspace(0.0, 1.0, GRID_SIZE))
    soils = np.stack(
        [np.full(GRID_SIZE, cohesion), np.full(GRID_SIZE, friction_angle), modulus], axis=1
    )
    moduli = []
    for residual in ForceBalances.tabulate(rover, assumed, RANGE).residuals(soils).T:
        crossings = np.flatnonzero((residual[:-1] > 0.0) & (residual[1:] <= 0.0))
        if len(crossings) == 0:
            moduli.append(np.nan)
            continue
        i = int(crossings[0])
        share = residual[i] / (residual[i] - residual[i + 1])  # linear in ln k_x
        moduli.append(float(modulus[i] * (modulus[i + 1] / modulus[i]) ** share))
    return np.asarray(moduli)
