"""Shear modulus and stress magnification from the force balance of a wheel on a slope."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Real
from soilml.errors import FitError
from soilml.parameters import Parameter, check
from soilml.physics.operating_point import MOST_SLIP
from soilml.systems.force_sensor_wheel.sensor_readings import SensingWheel
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile
from soilml.systems.force_sensor_wheel.wheel_forces import ShearInputs, integrate_profile


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


@final
@dataclass(frozen=True, kw_only=True)
class MohrCoulomb:
    """Shear strength parameters of the soil, which must be known beforehand."""

    friction_angle: Annotated[Real, Parameter("rad", 0.0, 1.4, "phi")]
    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6, "c")] = 0.0

    def __post_init__(self) -> None:
        check(self, "strength: ")


#: Range of shear moduli searched, m: at the lower end the shear strength is mobilised at once, at
#: the upper end practically no shear is mobilised within the contact of any wheel.
STIFFEST, SOFTEST = 1e-5, 10.0
#: The range is searched on a grid, and the interval with the sign change is refined by a grid of
#: the same size: 6 refinements determine k_x to a relative 1e-9.
GRID_SIZE, REFINEMENTS = 32, 6


@dataclass(frozen=True)
class BalanceSolution:
    """Solution of both balances: true over measured stress M, and the shear modulus k_x (m)."""

    magnification: float
    shear_modulus: float


def solve_force_balance(
    profile: StressProfile, at: SteadyRun, wheel: SensingWheel, strength: MohrCoulomb
) -> BalanceSolution:
    r"""Solve the vertical and the horizontal force balance of a wheel on a slope for M and k_x.

    .. math::
        F_z(M, k_x) = m g \cos\alpha, \qquad F_x(M, k_x) = m g \sin\alpha

    F_z is linear in M, so that M follows from k_x in closed form. The excess of the drawbar pull
    over the pull that the slope requires is then evaluated on a grid of k_x, and the one interval
    in which it changes sign is refined. Without cohesion, and if the angle on the rim plus the
    slope stays below a right angle, the excess changes sign at most once; with cohesion, none of
    3000 random arcs had two solutions.

    Parameters
    ----------
    profile
        Measured normal stress on the rim.
    at
        Slip, weight on the wheel (N) and slope (rad).
    wheel
        Radius and width.
    strength
        Cohesion (Pa) and friction angle (rad) of the soil.

    Raises
    ------
    FitError
        If there is no solution (the message names the side on which the balance fails), or more
        than one.

    References
    ----------
    Nagatani et al. 2009, eqs. 11-15, who bisect for both unknowns.

    Examples
    --------
    >>> import math
    >>> run = SteadyRun(slip=0.29, weight=28.92, slope=math.radians(4.0))
    >>> wheel, sand = SensingWheel(), MohrCoulomb(friction_angle=math.radians(38.0))
    >>> from soilml.systems.force_sensor_wheel import balanced_arc
    >>> arc = balanced_arc(math.radians(30.0), run, wheel, sand, shear_modulus=0.0072)
    >>> solution = solve_force_balance(arc, run, wheel, sand)
    >>> round(solution.magnification, 3), round(solution.shear_modulus, 5)
    (1.0, 0.0072)
    """
    modulus = np.geomspace(STIFFEST, SOFTEST, GRID_SIZE)
    excess, magnification = excess_pull(profile, at, wheel, strength, modulus)
    if not np.isfinite(excess).any():
        raise FitError(
            "no magnification carries the weight at any shear modulus: cohesion alone carries "
            "more, or the shear of this braking wheel pulls it down; check cohesion and slip"
        )
    crossings = _sign_changes(excess)
    if len(crossings) == 0:
        raise FitError(_no_solution(excess, at))
    if len(crossings) > 1:
        intervals = ", ".join(f"{modulus[i]:.2g} to {modulus[i + 1]:.2g}" for i in crossings)
        raise FitError(
            f"{len(crossings)} shear moduli satisfy both balances, in m: {intervals}; a run at "
            "another slip or slope is needed to choose"
        )
    i = int(crossings[0])
    for _ in range(REFINEMENTS):
        modulus = np.geomspace(modulus[i], modulus[i + 1], GRID_SIZE)
        excess, magnification = excess_pull(profile, at, wheel, strength, modulus)
        crossings = _sign_changes(excess)
        i = int(crossings[0]) if len(crossings) else 0  # rounding may hide the last sign change
    return BalanceSolution(float(magnification[i]), float(modulus[i]))


def excess_pull(
    profile: StressProfile,
    at: SteadyRun,
    wheel: SensingWheel,
    strength: MohrCoulomb,
    modulus: Floats,
) -> tuple[Floats, Floats]:
    """Drawbar pull (N) beyond what the slope requires, and M, at shear moduli (m), (n,).

    NaN where no magnification carries the weight.
    """
    weight, slope = float(at.weight), float(at.slope)
    magnification, pull = solve_vertical_balance(profile, at, wheel, strength, modulus)
    return pull - weight * math.sin(slope), magnification


def solve_vertical_balance(
    profile: StressProfile,
    at: SteadyRun,
    wheel: SensingWheel,
    strength: MohrCoulomb,
    modulus: Floats,
) -> tuple[Floats, Floats]:
    """M that carries the weight at shear moduli (m), (n,), and the drawbar pull (N) with that M.

    Load and pull are linear in M: their values at M = 0 and M = 1 determine them.
    """
    at_zero_and_one = integrate_profile(
        profile,
        ShearInputs(
            magnification=np.asarray([[0.0], [1.0]]),
            shear_modulus=modulus,
            cohesion=strength.cohesion,
            friction_angle=strength.friction_angle,
            slip=at.slip,
            radius=wheel.radius,
            width=wheel.width,
        ),
    )
    load, pull = at_zero_and_one.load, at_zero_and_one.drawbar_pull
    load_per_magnification = load[1] - load[0]
    required = float(at.weight) * math.cos(float(at.slope)) - load[0]
    solvable = (load_per_magnification > 0) & (required > 0)
    magnification = np.where(
        solvable, required / np.where(solvable, load_per_magnification, 1.0), np.nan
    )
    return magnification, pull[0] + magnification * (pull[1] - pull[0])


def _sign_changes(excess: Floats) -> NDArray[np.intp]:
    """Indices of the intervals in which the excess pull changes sign."""
    finite, positive = np.isfinite(excess), excess > 0
    return np.flatnonzero((positive[1:] != positive[:-1]) & finite[1:] & finite[:-1])


def _no_solution(excess: Floats, at: SteadyRun) -> str:
    """Why no shear modulus balances the pull."""
    required = float(at.weight) * math.sin(float(at.slope))
    finite = excess[np.isfinite(excess)]
    if finite[0] < 0:
        return (
            f"even with fully mobilised shear the wheel pulls {finite.max() + required:.3g} N, and "
            f"the slope requires {required:.3g} N: the stress is too far forward for this friction "
            "angle, slip and slope; check the zero of the angle, and that forward is positive"
        )
    return (
        f"even with hardly any shear the wheel pulls {finite.min() + required:.3g} N, and the "
        f"slope requires {required:.3g} N: the stress is too far back; check the zero of the "
        "angle, that forward is positive, and the sign of the slope"
    )


HALVINGS = 40  # Bisection steps for the middle of an arc


def parabolic_arc(
    middle: float, length: float, peak: float, lean: float = 0.0, points: int = 201
) -> StressProfile:
    r"""A parabola of normal stress over an arc of the rim, optionally skewed forward.

    .. math::
        \sigma = \sigma_p (1 - u^2)(1 + \lambda u), \quad u = 2 (\theta - \theta_c) / l

    `middle` and `length` in rad, `peak` (Pa) the stress at the middle, `lean` from -1 to 1. The
    shape is our choice: Nagatani et al. 2009 print the length of the arc (section IV), and its
    shape only as a figure.
    """
    u = np.linspace(-1.0, 1.0, points)
    normal = peak * (1.0 - u**2) * (1.0 + lean * u)
    return StressProfile(middle + 0.5 * length * u, np.maximum(normal, 0.0))


def balanced_arc(
    length: float,
    at: SteadyRun,
    wheel: SensingWheel,
    strength: MohrCoulomb,
    shear_modulus: float,
    lean: float = 0.0,
) -> StressProfile:
    """The arc of this length (rad) that satisfies both force balances of the run.

    The further forward an arc is, the smaller its pull: its middle is found by bisection over all
    positions below the axle, its magnitude from the load. Nagatani et al. 2009 print k_x and the
    length of the arc but not its position; this is the position consistent with both. Raises
    `FitError` if there is none.
    """
    modulus = np.asarray([shear_modulus])

    def excess_and_size(middle: float) -> tuple[float, float]:
        arc = parabolic_arc(middle, length, 1.0, lean)
        pull, size = excess_pull(arc, at, wheel, strength, modulus)
        return float(pull[0]), float(size[0])

    def too_far_back(middle: float) -> bool:
        return not excess_and_size(middle)[0] <= 0.0  # NaN where its shear pulls the wheel down

    rear, front = -0.45 * np.pi + 0.5 * length, 0.45 * np.pi - 0.5 * length
    if not rear < front or not too_far_back(rear) or too_far_back(front):
        raise FitError(
            f"no position of an arc of {length:g} rad lets the wheel pull "
            f"{float(at.weight) * np.sin(at.slope):.3g} N at slip {float(at.slip):g}"
        )
    for _ in range(HALVINGS):
        middle = 0.5 * (rear + front)
        rear, front = (middle, front) if too_far_back(middle) else (rear, middle)
    return parabolic_arc(front, length, excess_and_size(front)[1], lean)
