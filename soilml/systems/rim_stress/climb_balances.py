"""Force balances of climbs: their residuals, and the covariance of these by the measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Real
from soilml.errors import FitError
from soilml.numerics.prior import Prior
from soilml.systems.rim_stress.climb import Climb, Rover, ShearParameters, Uncertainty, WheelRun
from soilml.systems.rim_stress.force_balance import (
    LIFT,
    PULL,
    find_modulus,
    force_components,
    force_of,
    magnification,
)

#: Values of k_x, evenly spaced in the logarithm, between which forces are interpolated linearly;
#: extension of ln k_x beyond both ends of the prior, against rounding.
KNOTS, MARGIN = 256, 1e-6
#: Lower limit of the standard deviation of a balance, as a fraction of the weight.
MIN_STD_FRACTION = 1e-4
#: Step of forward differences: fraction of the speed, rad of a slope or of an entry angle. Well
#: below the usual standard deviations of these quantities.
STEP = 1e-3
MIN_SPAN = 0.1  # Smallest range of tan(slope) from which the height of the mass is estimated


def wheel_components(wheel: WheelRun, rover: Rover, modulus: Real) -> Floats:
    """The components of a wheel's forces at each k_x (m), (3, 3, ...)."""
    return force_components(wheel.profile, wheel.slip, modulus, rover.radius, rover.width)


def pull_of_rover(
    rover: Rover, slope: Real, wheels: Sequence[Floats], cohesion: Real, tangent: Real
) -> Real:
    r"""Drawbar pull 2 (F_xf + F_xr) (N) of a rover whose wheels carry its weight on the slope.

    The vertical balance, :math:`2 (F_{zf} + F_{zr}) = m g \cos\alpha`, gives the magnification: one
    for each wheel if the loads of the wheels are known, else one for both. `wheels` are the
    components of front and rear. References: Nagatani et al., eqs. 6, 7, 10 and 11.
    """
    loaded: list[tuple[Floats, Real]] = [
        (wheels[0] + wheels[1], 0.5 * rover.weight * np.cos(slope))
    ]
    if rover.has_known_loads:
        loaded = list(zip(wheels, rover.loads(slope), strict=True))
    pulls = [
        force_of(parts, PULL, magnification(parts, load, cohesion, tangent), cohesion, tangent)
        for parts, load in loaded
    ]
    return 2.0 * sum(pulls)


@dataclass(frozen=True)
class ForceBalances:
    """The climbs of one rover, with wheel forces tabulated over the range of k_x."""

    rover: Rover
    climbs: tuple[Climb, ...]
    log_modulus: Floats  # (KNOTS,)
    wheels: tuple[Floats, Floats]  # front and rear, each (3, 3, climbs, KNOTS)

    @classmethod
    def tabulate(cls, rover: Rover, climbs: Sequence[Climb], modulus: Prior) -> ForceBalances:
        """Tabulate the wheel forces between the ends of the prior of k_x (m)."""
        knots = np.linspace(np.log(modulus.lower) - MARGIN, np.log(modulus.upper) + MARGIN, KNOTS)
        front, rear = (
            np.stack([wheel_components(c.wheels[i], rover, np.exp(knots)) for c in climbs], axis=2)
            for i in range(2)
        )
        return cls(rover, tuple(climbs), knots, (front, rear))

    def residuals(self, soils: Floats) -> Floats:
        """Pull less the weight's component along the slope, N (n, climbs).

        `soils` (n, 3) are cohesion (Pa), friction angle (rad) and shear modulus (m).
        """
        cohesion, friction, modulus = soils.T
        position = np.interp(np.log(modulus), self.log_modulus, np.arange(KNOTS))
        knot = np.minimum(position.astype(int), KNOTS - 2)
        share = position - knot
        wheels = [v[..., knot] * (1.0 - share) + v[..., knot + 1] * share for v in self.wheels]
        slope = np.asarray([climb.slope for climb in self.climbs])[:, None]
        pull = pull_of_rover(self.rover, slope, wheels, cohesion, np.tan(friction))
        return np.asarray(pull - self.rover.weight * np.sin(slope)).T

    def whitener(self, shear: ShearParameters, noise: Uncertainty) -> tuple[Floats, Floats]:
        """Whitening matrix and standard deviations of the residuals at one soil.

        Returns (L, std): L @ residuals has unit covariance, L (climbs, climbs); std (climbs,), N.
        """
        stds = np.asarray([balance_std(self.rover, c, shear, noise) for c in self.climbs])
        lower_limit = MIN_STD_FRACTION * self.rover.weight
        covariance = np.diag(stds[:, 0] ** 2 + lower_limit**2) + stds[:, 1:] @ stds[:, 1:].T
        return np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(np.diag(covariance))


def balance_std(
    rover: Rover, climb: Climb, shear: ShearParameters, noise: Uncertainty
) -> tuple[float, float, float]:
    """Standard deviations of a climb's balance, N: (independent, by speed scale, by entry angle).

    The first combines speed, slope, stress and front load of this run alone; the others come from
    errors that all runs share, of the speed scale and of the entry angles. First order at the soil
    `shear`: the effective variance of the balance. References: Orear, Am. J. Phys. 50(10), 1982.
    """
    cohesion, tangent, modulus = shear[0], float(np.tan(shear[1])), shear[2]

    def residual(wheels: Sequence[WheelRun], slope: float = climb.slope) -> float:
        parts = [wheel_components(wheel, rover, modulus) for wheel in wheels]
        pull = pull_of_rover(rover, slope, parts, cohesion, tangent)
        return float(pull - rover.weight * np.sin(slope))

    here = residual(climb.wheels)
    by_speed = (residual(climb.with_speed_error(STEP).wheels) - here) / STEP
    by_entry = (residual([wheel.with_entry(STEP) for wheel in climb.wheels]) - here) / STEP
    by_slope = (residual(climb.wheels, climb.slope + STEP) - here) / STEP
    independent = [noise.speed * by_speed, noise.slope * by_slope]
    # load moved between the axles, and noise of the stress: at a given load more stress at one
    # angle means less elsewhere, and counts by the difference of ratios of pull to load
    front, rear = wheels = [wheel_components(wheel, rover, modulus) for wheel in climb.wheels]
    scales = wheel_magnifications(rover, climb.slope, wheels, cohesion, tangent)
    known = rover.has_known_loads
    ratios = [_pull_ratio(p, tangent) for p in (wheels if known else [front + rear] * 2)]
    apart = _pull_ratio(front, tangent) - _pull_ratio(rear, tangent)
    on_front = float(force_of(front, LIFT, scales[0], cohesion, tangent))
    independent.append(2.0 * noise.front_load * on_front * apart)
    for wheel, scale, ratio in zip(climb.wheels, scales, ratios, strict=True):
        pull, lift = _per_stress(wheel, rover, tangent, modulus)
        by_stress = 2.0 * scale * (pull - ratio * lift) * wheel.normal_std
        independent.append(float(np.linalg.norm(by_stress)))
    std = float(np.linalg.norm(independent))
    return std, noise.speed_scale * by_speed, noise.entry_angle * by_entry


def wheel_magnifications(
    rover: Rover, slope: float, wheels: Sequence[Floats], cohesion: float, tangent: float
) -> list[float]:
    """M of the front and of the rear wheel."""
    if rover.has_known_loads:
        loads = zip(wheels, rover.loads(slope), strict=True)
        return [float(magnification(p, load, cohesion, tangent)) for p, load in loads]
    half = 0.5 * rover.weight * np.cos(slope)
    return [float(magnification(wheels[0] + wheels[1], half, cohesion, tangent))] * 2


def _pull_ratio(parts: Floats, tangent: float) -> float:
    """Pull over load on soil without cohesion."""
    return float(
        force_of(parts, PULL, 1.0, 0.0, tangent) / force_of(parts, LIFT, 1.0, 0.0, tangent)
    )


def _per_stress(
    wheel: WheelRun, rover: Rover, tangent: float, modulus: float
) -> tuple[Floats, Floats]:
    """Pull and lift per unit stress at each sample (N per Pa), (p,); 0 outside the contact."""
    profile, angle = wheel.profile, wheel.profile.angle
    entry = profile.entry_angle
    shear_angle = entry - angle - (1.0 - wheel.slip) * (np.sin(entry) - np.sin(angle))
    mobilised = -np.expm1(-rover.radius * np.abs(shear_angle) / modulus)
    friction = (-1.0 if wheel.slip < 0 else 1.0) * tangent * mobilised
    area = rover.radius * rover.width * np.gradient(angle)
    area = np.where((angle >= profile.exit_angle) & (angle <= entry), area, 0.0)
    pull = area * (friction * np.cos(angle) - np.sin(angle))
    return pull, area * (friction * np.sin(angle) + np.cos(angle))


def modulus_per_climb(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    cohesion: float,
    friction_angle: float,
    speed_error: float = 0.0,
) -> Floats:
    """k_x (m) at which the forces of each climb balance (climbs,); NaN where none does.

    With `speed_error` the climbs are evaluated as if the speeds had been measured too high by this
    fraction. References: Nagatani et al., section 6.2, Figs. 8 and 9.
    """
    moduli, tangent = [], float(np.tan(friction_angle))
    for climb in (climb.with_speed_error(speed_error) for climb in climbs):

        def pull(modulus: Floats, climb: Climb = climb) -> Floats:
            parts = [wheel_components(wheel, rover, modulus) for wheel in climb.wheels]
            return np.asarray(pull_of_rover(rover, climb.slope, parts, cohesion, tangent))

        try:
            moduli.append(find_modulus(pull, float(rover.weight * np.sin(climb.slope))))
        except FitError:
            moduli.append(np.nan)
    return np.asarray(moduli)


def estimate_wheel_loads(rover: Rover, climbs: Sequence[Climb], shear: ShearParameters) -> Rover:
    r"""The rover with its centre of mass estimated from the climbs if it is unknown.

    .. math:: \frac{F_{zf}}{F_{zf} + F_{zr}} = a - h \tan\alpha

    is fitted by least squares to the front wheels' share of the load in each climb at the soil
    `shear`, with one magnification for both wheels of a run. h is estimated if three climbs or more
    span 0.1 in tan(alpha), and is 0 otherwise; a and h are limited to their bounds.
    """
    if rover.has_known_loads:
        return rover
    cohesion, tangent, modulus = shear[0], float(np.tan(shear[1])), shear[2]
    shares = []
    for climb in climbs:
        wheels = [wheel_components(wheel, rover, modulus) for wheel in climb.wheels]
        scale = wheel_magnifications(rover, climb.slope, wheels, cohesion, tangent)[0]
        front, rear = (float(force_of(p, LIFT, scale, cohesion, tangent)) for p in wheels)
        shares.append(front / (front + rear))
    gradient = np.tan([climb.slope for climb in climbs])
    spans = len(climbs) > 2 and np.ptp(gradient) > MIN_SPAN
    fall, share = np.polyfit(gradient, shares, 1) if spans else (0.0, np.mean(shares))
    return replace(
        rover,
        front_share=float(np.clip(share, 0.05, 0.95)),
        height_ratio=float(np.clip(-fall, 0.0, 2.0)),
    )
