"""Climbs of a rover with force sensors in two rims: its file, its force balances, their noise."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, final

import numpy as np

from soilml.arrays import Floats, Real
from soilml.config.measurement_noise import Noise, NoiseOfReading
from soilml.config.model_settings import take_priors
from soilml.errors import FitError, InputError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter
from soilml.systems.rim_stress.force_balance import (
    SlopePull,
    find_modulus,
    force_components,
    magnification,
    pull_ratio,
)
from soilml.systems.rim_stress.stress import StressProfile

#: Cohesion (Pa), friction angle (rad), shear modulus (m).
ShearParameters = tuple[float, float, float]
WHEELS = ("front", "rear")  # The wheels of one side; both sides carry and pull equally
#: Values of k_x, evenly spaced in the logarithm, between which forces are interpolated linearly;
#: extension of ln k_x beyond both ends of the prior, against rounding.
KNOTS, MARGIN = 256, 1e-6
#: Lower limit of the standard deviation of a balance, as a fraction of the weight.
MIN_STD_FRACTION = 1e-4
#: Step of forward differences: fraction of the speed, rad of a slope or of an entry angle. Well
#: below the usual standard deviations of these quantities.
STEP = 1e-3
_SHARE = Parameter("1", 0.0, 1.0, "standard deviation")
_ANGLE = Parameter("rad", 0.0, 1.0, "standard deviation")
_SPEED, _STRESS = Noise(share=0.0087), Noise(share=0.05)  # A speed is uniform within 1.5 %


@final
@dataclass(frozen=True, kw_only=True)
class Rover:
    """Two front and two rear wheels of equal size; fields are the keys of [rover]."""

    mass: Annotated[float, Parameter("kg", 0.01, 1e5, "mass of the whole rover")]
    radius: Annotated[float, Parameter("m", 0.005, 5.0, "wheel radius")]
    width: Annotated[float, Parameter("m", 0.002, 5.0, "wheel width")]
    front_share: Annotated[
        float, Parameter("1", 0.05, 0.95, "share of the weight on the front wheels, flat")
    ]
    height_ratio: Annotated[
        float, Parameter("1", 0.0, 2.0, "height of the centre of mass over the wheelbase")
    ]
    gravity: Annotated[float, Parameter("m/s^2", 0.01, 30.0, "gravity")] = 9.80665

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * self.gravity

    def loads(self, slope: Real) -> tuple[Real, Real]:
        r"""Load perpendicular to the slope on one front and one rear wheel, N.

        .. math::
            F_{zf} = \tfrac12 m g (a \cos\alpha - h \sin\alpha), \quad
            F_{zr} = \tfrac12 m g ((1 - a) \cos\alpha + h \sin\alpha)

        with a the front share on level ground and h the height of the centre of mass over the
        wheelbase: balance of moments about the wheel contacts at constant speed. The offset of
        the wheel forces from the axle is neglected.
        """
        across, along = 0.5 * self.weight * np.cos(slope), 0.5 * self.weight * np.sin(slope)
        front = self.front_share * across - self.height_ratio * along
        return front, across - front

    def parts(self, wheels: Sequence[WheelRun], modulus: Real) -> list[Floats]:
        """The components of the forces of each wheel at each k_x (m), (3, 3, ...)."""
        return [
            force_components(wheel.profile, wheel.slip, modulus, self.radius, self.width)
            for wheel in wheels
        ]

    def pull(
        self,
        parts: Sequence[Floats],
        cohesion: Real,
        tangent: Real,
        front_share: Real | None = None,
    ) -> SlopePull:
        r"""Drawbar pull 2 (F_xf + F_xr) of a rover whose wheels carry its weight, by the slope.

        Each wheel's ratio of pull to load on soil without cohesion is :math:`\rho`, and M of each
        wheel follows from its load (`loads`):

        .. math::
            F_x = m g [(a \rho_f + (1 - a) \rho_r) \cos\alpha + h (\rho_r - \rho_f) \sin\alpha]
                  + 2 c \sum (C_x - \rho C_z)

        parts: The components of front and rear. front_share: Other than that of the rover.

        References: Nagatani et al., eqs. 6, 7, 10 and 11.
        """
        share = self.front_share if front_share is None else front_share
        front, rear = (SlopePull.of_wheel(own, self.weight, cohesion, tangent) for own in parts)
        return SlopePull(
            weight=self.weight,
            cos_term=share * front.cos_term + (1.0 - share) * rear.cos_term,
            sin_term=self.height_ratio * (rear.cos_term - front.cos_term),
            constant=2.0 * (front.constant + rear.constant),
        )


@dataclass(frozen=True)
class WheelRun:
    """Stress on the rim of a wheel at one slip."""

    slip: float
    profile: StressProfile
    normal_std: Floats = field(default_factory=lambda: np.zeros(1))  # (p,) or (1,), Pa

    def with_entry(self, shift: float) -> WheelRun:
        """The wheel with its entry angle moved forward by `shift` (rad), the stress unchanged."""
        profile = self.profile
        kept = profile.angle < profile.entry_angle
        angle = np.append(profile.angle[kept], profile.entry_angle + shift)
        normal = np.append(profile.normal[kept], 0.0)
        return WheelRun(self.slip, StressProfile(angle, normal))


@dataclass(frozen=True)
class Climb:
    """A steady climb straight up a slope; the wheels of both sides behave equally."""

    name: str
    slope: float  # rad
    front: WheelRun
    rear: WheelRun

    @property
    def wheels(self) -> tuple[WheelRun, WheelRun]:
        """Front and rear."""
        return self.front, self.rear


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Standard deviations of the measurements on a climb, by the keys of [noise].

    `speed_m_s` is the relative error of the speed of each run, which both wheels of a rover have.
    `entry_angle_rad` is an error common to all runs,
    due to size, sampling and deadband of the sensors. `front_load` is the relative error of the
    load on the front wheels.
    """

    speed_m_s: Annotated[Noise, NoiseOfReading()] = _SPEED
    normal_Pa: Annotated[Noise, NoiseOfReading()] = _STRESS  # noqa: N815
    slope_rad: Annotated[float, _ANGLE] = 0.005
    entry_angle_rad: Annotated[float, _ANGLE] = 0.005  # about half a sample
    front_load: Annotated[float, _SHARE] = 0.05

    def __post_init__(self) -> None:
        """Raise `InputError` for a speed whose error is no share of it, and for exact stresses."""
        if self.speed_m_s.constant or not self.speed_m_s.share:
            raise InputError(
                "speed_m_s must be a percentage, such as '0.9 %': slip is a ratio of speeds"
            )
        if self.normal_Pa == Noise():
            raise InputError("normal_Pa is 0; a standard deviation must be above zero")


@final
@dataclass(frozen=True, kw_only=True)
class FixedShearParameters:
    """Shear parameters of the soil with known values."""

    cohesion: Annotated[float | None, Parameter("Pa", 0.0, 1e6, "c")] = None
    friction_angle: Annotated[float | None, Parameter("rad", 0.02, 1.4, "phi")] = None
    shear_modulus: Annotated[float | None, Parameter("m", 1e-5, 1.0, "k_x")] = None


@dataclass(frozen=True)
class RoverFile:
    """Content of a rover file: the rover, known values and priors of the soil, noise."""

    rover: Rover
    fixed: dict[str, float]
    prior: dict[str, Prior]
    noise: Uncertainty


def read_rover(path: str | os.PathLike[str]) -> RoverFile:
    """Read [rover], [soil] and [noise]; raises `InputError` naming file, table and key."""
    settings = read_settings(path)
    own, soil = settings.table("rover"), settings.table("soil")
    if "wheels" in own:
        own.fail(
            "a rover by its wheels is for soilml pull; climb needs mass, radius and width of four "
            "equal wheels"
        )
    rover, priors = take_declared(Rover, own), soil.table("prior")
    known = vars(take_declared(FixedShearParameters, soil))
    fixed = {name: value for name, value in known.items() if value is not None}
    prior = take_priors(priors, FixedShearParameters)
    for name, taken in prior.items():
        if name in fixed:
            priors.fail(f"{name} is a number in [soil] and has a range here; remove one of them")
        if name == "shear_modulus" and not taken.log:
            prior[name] = Prior(taken.lower, taken.upper, log=True)
    noise = take_declared(Uncertainty, settings.table("noise"))
    settings.finish()
    return RoverFile(rover, fixed, prior, noise)


def count_apart(values: Sequence[float] | Floats, apart: float) -> int:
    """Number of values that differ from each other by more than `apart`."""
    count, last = 0, -np.inf
    for value in np.sort(values):
        if value - last > apart:
            count, last = count + 1, float(value)
    return count


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
        each = [rover.parts(climb.wheels, np.exp(knots)) for climb in climbs]
        front, rear = (np.stack(wheel, axis=2) for wheel in zip(*each, strict=True))
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
        pull = self.rover.pull(wheels, cohesion, np.tan(friction)).pull(slope)
        return np.asarray(pull - self.rover.weight * np.sin(slope)).T

    def whitener(self, shear: ShearParameters, noise: Uncertainty) -> tuple[Floats, Floats]:
        """Whitening matrix and standard deviations of the residuals at one soil.

        Returns (L, std): L @ residuals has unit covariance, L (climbs, climbs); std (climbs,), N.
        """
        stds = np.asarray([balance_std(self.rover, c, shear, noise) for c in self.climbs])
        lower_limit = MIN_STD_FRACTION * self.rover.weight
        covariance = np.diag(stds[:, 0] ** 2 + lower_limit**2) + np.outer(stds[:, 1], stds[:, 1])
        return np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(np.diag(covariance))


def balance_std(
    rover: Rover, climb: Climb, shear: ShearParameters, noise: Uncertainty
) -> tuple[float, float]:
    """Standard deviations of a climb's balance, N: (independent, by entry angle).

    The first combines speed, slope, stress and front load of this run alone; the other comes from
    the error of the entry angles that all runs share. First order at the soil `shear`: the
    effective variance of the balance. References: Orear, Am. J. Phys. 50(10), 1982.
    """
    cohesion, tangent, modulus = shear[0], float(np.tan(shear[1])), shear[2]

    def residual(
        wheels: Sequence[WheelRun] = climb.wheels,
        slope: float = climb.slope,
        share: float = rover.front_share,
    ) -> float:
        pull = rover.pull(rover.parts(wheels, modulus), cohesion, tangent, share).pull(slope)
        return float(pull - rover.weight * np.sin(slope))

    # a speed read too high gives slips that are too low
    faster = [replace(w, slip=1.0 - (1.0 - w.slip) * (1.0 + STEP)) for w in climb.wheels]
    ahead = [wheel.with_entry(STEP) for wheel in climb.wheels]
    moved = [residual(faster), residual(ahead), residual(slope=climb.slope + STEP)]
    moved.append(residual(share=rover.front_share * (1.0 + STEP)))
    by_speed, by_entry, by_slope, by_share = (np.asarray(moved) - residual()) / STEP
    independent = [noise.speed_m_s.share * by_speed, noise.slope_rad * by_slope]
    independent.append(noise.front_load * by_share)
    # at a given load more stress at one angle means less elsewhere, and counts by the difference
    # of ratios of pull to load
    loads = rover.loads(climb.slope)
    for wheel, parts, load in zip(
        climb.wheels, rover.parts(climb.wheels, modulus), loads, strict=True
    ):
        scale = float(magnification(parts, load, cohesion, tangent))
        pull, lift = _per_stress(wheel, rover, tangent, modulus)
        by_stress = 2.0 * scale * (pull - float(pull_ratio(parts, tangent)) * lift)
        independent.append(float(np.linalg.norm(by_stress * wheel.normal_std)))
    std = float(np.linalg.norm(independent))
    return std, noise.entry_angle_rad * by_entry


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
    rover: Rover, climbs: Sequence[Climb], *, cohesion: float, friction_angle: float
) -> Floats:
    """k_x (m) at which the forces of each climb balance (climbs,); NaN where none does.

    References: Nagatani et al., section 6.2 and Fig. 8.
    """
    tangent = float(np.tan(friction_angle))

    def modulus(climb: Climb) -> float:
        def pull(k: Floats) -> Floats:
            found = rover.pull(rover.parts(climb.wheels, k), cohesion, tangent)
            return np.asarray(found.pull(climb.slope))

        try:
            return find_modulus(pull, rover.weight * math.sin(climb.slope))
        except FitError:
            return math.nan

    return np.asarray([modulus(climb) for climb in climbs])
