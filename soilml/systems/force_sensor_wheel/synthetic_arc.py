"""Short stressed arcs, to try methods on."""

from __future__ import annotations

import numpy as np

from soilml.errors import FitError
from soilml.systems.force_sensor_wheel.force_balance import excess
from soilml.systems.force_sensor_wheel.sensor_model import SensingWheel
from soilml.systems.force_sensor_wheel.steady_run import Run, Strength
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Halvings of the way in which the middle of an arc is looked for.
HALVINGS = 40


def stressed_arc(
    middle: float, length: float, peak: float, lean: float = 0.0, points: int = 201
) -> StressProfile:
    r"""A parabola of normal stress over an arc of the rim, which may lean forward.

    .. math::
        \sigma = \sigma_p (1 - u^2)(1 + \lambda u), \quad u = 2 (\theta - \theta_c) / l

    `middle` and `length` in rad, `peak` (Pa) the stress at the middle, `lean` from -1 to 1. Own
    choice of shape: Nagatani et al. 2009 print how long the arc is (section IV), and its shape as
    a picture only.
    """
    u = np.linspace(-1.0, 1.0, points)
    normal = peak * (1.0 - u**2) * (1.0 + lean * u)
    return StressProfile(middle + 0.5 * length * u, np.maximum(normal, 0.0))


def balanced_arc(
    length: float,
    at: Run,
    wheel: SensingWheel,
    strength: Strength,
    shear_modulus: float,
    lean: float = 0.0,
) -> StressProfile:
    """The arc of this length (rad) that carries and drives the wheel as the run does.

    The further forward an arc lies, the less it pulls: its middle is found by bisection between
    the ends that leave it below the axle, its size from the load. Where k_x and the length of the
    arc are known and its place is not, as in Nagatani et al. 2009, this is the place that goes
    with them. Raises `FitError` where no place does.
    """
    modulus = np.asarray([shear_modulus])

    def left(middle: float) -> tuple[float, float]:
        arc = stressed_arc(middle, length, 1.0, lean)
        pull, size = excess(arc, at, wheel, strength, modulus)
        return float(pull[0]), float(size[0])

    def too_far_back(middle: float) -> bool:
        return not left(middle)[0] <= 0.0  # NaN where its shear pulls the wheel down

    rear, front = -0.45 * np.pi + 0.5 * length, 0.45 * np.pi - 0.5 * length
    if not rear < front or not too_far_back(rear) or too_far_back(front):
        raise FitError(
            f"no place of an arc of {length:g} rad lets the wheel pull "
            f"{float(at.weight) * np.sin(at.slope):.3g} N at slip {float(at.slip):g}"
        )
    for _ in range(HALVINGS):
        middle = 0.5 * (rear + front)
        rear, front = (middle, front) if too_far_back(middle) else (rear, middle)
    return stressed_arc(front, length, left(front)[1], lean)
