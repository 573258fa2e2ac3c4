"""Forces of a wheel under measured stress, and the shear modulus that balances them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from soilml.arrays import Floats, Real
from soilml.errors import FitError
from soilml.parameters import Parameter, check
from soilml.physics.contact import Stress, integrate
from soilml.physics.gears.rigid_wheel import WheelArc, contact_at
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.physics.soils import Soil
from soilml.remarks import Remark
from soilml.systems.rim_stress.stress import SensingWheel, StressProfile

LIFT, PULL, TORQUE = range(3)  # First axis of components: N, N and N m
#: Range of k_x that is searched, m: shear mobilised at once, and hardly any in a wheel's contact;
#: points of the grid, which is laid again over the interval with the root.
STIFFEST, SOFTEST, GRID_SIZE, REFINEMENTS = 1e-5, 10.0, 64, 2
#: Ratio of true to measured stress, or its inverse, that no loss of sensors explains.
MOST_MAGNIFICATION = 30.0


@final
@dataclass(frozen=True, kw_only=True)
class SteadyRun:
    """A steady run up a slope, with the standard deviations of the measured quantities.

    The wheel carries weight cos(slope) and pulls weight sin(slope): Nagatani et al. 2009, eqs. 14
    and 15. Valid for a rover whose wheels share weight and pull equally.
    """

    slip: Annotated[Real, Parameter("1", -MOST_SLIP, MOST_SLIP, "slip ratio")]
    weight: Annotated[Real, Parameter("N", 1e-6, 1e7, "m g, on this wheel")]
    slope: Annotated[Real, Parameter("rad", -1.2, 1.2, "alpha, uphill positive")] = 0.0
    slip_std: Annotated[Real, Parameter("1", 0.0, 1.0)] = 0.0
    weight_std: Annotated[Real, Parameter("N", 0.0, 1e7)] = 0.0
    slope_std: Annotated[Real, Parameter("rad", 0.0, 1.2)] = 0.0

    def __post_init__(self) -> None:
        check(self, "run: ")

    @property
    def load(self) -> float:
        """Load perpendicular to the slope, N."""
        return float(self.weight) * math.cos(float(self.slope))

    @property
    def required(self) -> float:
        """Pull that the slope requires, N."""
        return float(self.weight) * math.sin(float(self.slope))


def force_components(
    profile: StressProfile, slip: float, modulus: Real, radius: float, width: float
) -> Floats:
    r"""Load, pull and torque of a wheel per unit of M, of M tan(phi) and of c, (3, 3, ...).

    .. math::
        F_x = r b \int (\tau \cos\theta - M \sigma_s \sin\theta) d\theta, \quad
        F_z = r b \int (\tau \sin\theta + M \sigma_s \cos\theta) d\theta

        \tau = (c + M \sigma_s \tan\varphi) (1 - e^{-|j| / k_x}), \quad
        j = r [\theta_f - \theta - (1 - s)(\sin\theta_f - \sin\theta)]

    where tau has the sign of the slip and theta_f is the entry angle of the profile. Forces are
    linear in M, M tan(phi) and c. First axis: `LIFT`, `PULL`, `TORQUE`. Not valid for wheels whose
    lugs carry the load elsewhere on the rim than the sensors measure it. References: Nagatani et
    al. 2009, eqs. 10-13.

    profile: Measured normal stress sigma_s.
    slip: Negative for a braking wheel.
    modulus (...): k_x, m.
    radius, width: Of the wheel, m.
    """
    k = np.asarray(modulus, dtype=np.float64)
    angle, arc, normal = (part[:, None, None] for part in profile.nodes)
    entry = np.asarray(profile.entry_angle)
    rim = WheelArc(
        entry=entry,
        exit=np.asarray(profile.exit_angle),
        peak=np.asarray(profile.peak_angle),
        sinkage=radius * (1.0 - np.cos(entry)),
        radius=radius,
        shear_radius=radius,
        lever=np.asarray(radius),
        width=width,
    )
    none = np.zeros_like(angle)
    at = Operating(slip=np.asarray(slip), load=none)
    contact = contact_at(rim, at, entry - angle, none, arc, "slip-sign")
    mobilised = -np.expm1(-np.abs(contact.shear_displacement) / k.reshape(1, 1, -1))
    terms = np.asarray([1.0, 0.0, 0.0]), np.asarray([0.0, 1.0, 0.0]), np.asarray([0.0, 0.0, 1.0])
    pressed, rubbed, bonded = (term[None, :, None] for term in terms)
    shear = (-1.0 if slip < 0 else 1.0) * mobilised * (rubbed * normal + bonded)
    forces = integrate(Stress(contact=contact, normal=pressed * normal, shear=shear))
    wide = [np.broadcast_to(force, (3, k.size)) for force in forces]
    return np.stack(wide).reshape(3, 3, *k.shape)


def force_of(parts: Floats, force: int, magnification: Real, cohesion: Real, tangent: Real) -> Real:
    """Load, pull (N) or torque (N m) at M, c (Pa) and tan(phi); see `force_components`."""
    pressed, rubbed, bonded = parts[force]
    return np.asarray(magnification * (pressed + tangent * rubbed) + cohesion * bonded)


def magnification(parts: Floats, load: Real, cohesion: Real, tangent: Real) -> Real:
    """M with which the wheel carries a load (N), at c (Pa) and tan(phi); only above 0 does it."""
    left = load - force_of(parts, LIFT, 0.0, cohesion, tangent)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(left / force_of(parts, LIFT, 1.0, 0.0, tangent))


def pull_ratio(parts: Floats, tangent: Real) -> Real:
    """Pull over load on soil without cohesion."""
    pull, lift = (force_of(parts, force, 1.0, 0.0, tangent) for force in (PULL, LIFT))
    return np.asarray(pull / lift)


def pull_under(parts: Floats, load: Real, cohesion: Real, tangent: Real) -> Real:
    """Drawbar pull (N) of a wheel that carries a load (N), at c (Pa) and tan(phi).

    NaN where no magnification carries the load.
    """
    scale = magnification(parts, load, cohesion, tangent)
    carried = (force_of(parts, LIFT, 1.0, 0.0, tangent) > 0.0) & (scale > 0.0)
    return np.where(carried, force_of(parts, PULL, scale, cohesion, tangent), np.nan)


@dataclass(frozen=True)
class SlopePull:
    """Drawbar pull (N) as cos_term cos(slope) + sin_term sin(slope) + constant."""

    weight: float  # N
    cos_term: Real
    sin_term: Real
    constant: Real

    @staticmethod
    def of_wheel(parts: Floats, weight: float, cohesion: Real, tangent: Real) -> SlopePull:
        """Of a wheel (`force_components`) that carries and pulls the components of its weight (N).

        M follows from the load: the pull is the ratio of pull to load without cohesion times the
        load, and what cohesion adds less the pull of the load that it carries instead.
        """
        ratio = pull_ratio(parts, tangent)
        of_cohesion = cohesion * (parts[PULL, 2] - ratio * parts[LIFT, 2])
        return SlopePull(weight, weight * ratio, 0.0, of_cohesion)

    def pull(self, slope: Real) -> Real:
        """Drawbar pull on a slope (rad), N."""
        return self.cos_term * np.cos(slope) + self.sin_term * np.sin(slope) + self.constant

    def equilibrium_slope(self) -> Real:
        r"""The slope (rad) on which the pull equals the weight's component along it.

        .. math::
            (m g - S) \sin\alpha - C \cos\alpha = K \quad\Rightarrow\quad
            \alpha = \arctan\frac{C}{m g - S} + \arcsin\frac{K}{\sqrt{(m g - S)^2 + C^2}}

        with C, S and K the three terms; the argument of the arcsine is limited to [-1, 1].
        """
        net_weight = self.weight - self.sin_term
        sine = np.clip(self.constant / np.hypot(net_weight, self.cos_term), -1.0, 1.0)
        return np.arctan2(self.cos_term, net_weight) + np.arcsin(sine)


@dataclass(frozen=True)
class WheelBalance:
    """The force balance of a wheel (radius, width, m) on soil of known strength (Pa, tan(phi))."""

    radius: float
    width: float
    cohesion: float
    tangent: float

    @staticmethod
    def of(wheel: SensingWheel, soil: Soil) -> WheelBalance:
        """Of a wheel on a soil, whose cohesion and friction angle count."""
        size = float(wheel.radius), float(wheel.width)
        return WheelBalance(*size, float(soil.cohesion), math.tan(float(soil.friction_angle)))

    def parts(self, profile: StressProfile, at: SteadyRun, modulus: Real) -> Floats:
        """`force_components` at k_x (m)."""
        return force_components(profile, float(at.slip), modulus, self.radius, self.width)

    def pull(self, profile: StressProfile, at: SteadyRun, modulus: Real) -> Real:
        """Drawbar pull (N) under the load of the run; NaN where no magnification carries it."""
        return pull_under(self.parts(profile, at, modulus), at.load, self.cohesion, self.tangent)

    def magnification(self, profile: StressProfile, at: SteadyRun, modulus: Real) -> float:
        """M, the true over the measured stress."""
        parts = self.parts(profile, at, modulus)
        return float(magnification(parts, at.load, self.cohesion, self.tangent))

    def on_slopes(self, profile: StressProfile, at: SteadyRun, modulus: Real) -> SlopePull:
        """The pull by the slope, of a wheel that carries and pulls the weight of the run."""
        parts = self.parts(profile, at, modulus)
        return SlopePull.of_wheel(parts, float(at.weight), self.cohesion, self.tangent)

    def modulus(self, profile: StressProfile, at: SteadyRun) -> float:
        """k_x (m) at which the wheel pulls what the slope requires; see `find_modulus`."""
        return find_modulus(lambda k: np.asarray(self.pull(profile, at, k)), at.required)


def find_modulus(pull: Callable[[Floats], Floats], required: float) -> float:
    """k_x (m) at which a pull, N (n,) at k_x (n,), is the required one.

    The pull of a driving wheel falls as k_x grows: without cohesion there is at most one solution.

    Raises `FitError` without a solution, which names the side, and for several. References:
    Nagatani et al. 2009, section V, where M and k_x are both bisected.
    """
    modulus = np.geomspace(STIFFEST, SOFTEST, GRID_SIZE)
    for _ in range(REFINEMENTS + 1):
        excess = pull(modulus) - required
        finite = np.isfinite(excess)
        if not finite.any():
            raise FitError(
                "no magnification carries the weight at any shear modulus: cohesion alone carries "
                "more, or the shear of this braking wheel pulls it down; check cohesion and slip"
            )
        positive = excess > 0.0
        crossed = np.flatnonzero((positive[1:] != positive[:-1]) & finite[1:] & finite[:-1])
        if len(crossed) > 1:
            ends = ", ".join(f"{modulus[i]:.2g} to {modulus[i + 1]:.2g}" for i in crossed)
            raise FitError(
                f"{len(crossed)} shear moduli satisfy both balances, in m: {ends}; a run at "
                "another slip or slope is needed to choose"
            )
        if len(crossed) == 0:
            raise FitError(_no_solution(excess[finite], required))
        i = int(crossed[0])
        share = float(excess[i] / (excess[i] - excess[i + 1]))
        found = float(modulus[i] * (modulus[i + 1] / modulus[i]) ** share)
        modulus = np.geomspace(modulus[i], modulus[i + 1], GRID_SIZE)
    return found


def _no_solution(excess: Floats, required: float) -> str:
    if excess[0] < 0:
        return (
            f"even with fully mobilised shear the wheel pulls {excess.max() + required:.3g} N, and "
            f"the slope requires {required:.3g} N: the stress is too far forward for this friction "
            "angle, slip and slope; check the zero of the angle, and that forward is positive"
        )
    return (
        f"even with hardly any shear the wheel pulls {excess.min() + required:.3g} N, and the "
        f"slope requires {required:.3g} N: the stress is too far back; check the zero of the "
        "angle, that forward is positive, and the sign of the slope"
    )


def unit_remarks(scales: Floats) -> list[Remark]:
    """That the stress, or the load, is probably in another unit, by M of each run, (n,)."""
    middle = float(np.nanmedian(scales))
    if 1.0 / MOST_MAGNIFICATION < middle < MOST_MAGNIFICATION:
        return []
    text = (
        f"the true stress is {middle:.3g} times the measured one: probably normal_Pa is in "
        f"{'kPa' if middle > 1.0 else 'another unit'}, or the weight is"
    )
    return [Remark("stress-unit", text, ("normal_Pa",))]
