"""Synthetic stress profiles on which methods are tested."""

from __future__ import annotations

import numpy as np

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.force_balance import ShearStrength, SteadyRun, excess_pull
from soilml.systems.force_sensor_wheel.sensor_readings import SensingWheel
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Bisection steps for the middle of an arc.
HALVINGS = 40


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
    strength: ShearStrength,
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
