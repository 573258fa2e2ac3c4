"""Where the shear displacement under a braking wheel changes its direction."""

from __future__ import annotations

import math

from soilml.arrays import Array, namespace

#: Newton's steps from a start that is off by a few per cent of the distance to the nearer extreme.
STEPS = 4


def reversals(entry: Array, leave: Array, slip: Array) -> tuple[Array, Array]:
    r"""Angles (rad) at which shear displacement is back at zero, and which of them there are.

    .. math::
        g(\theta) = g(\theta_1), \quad g(\theta) = (1 - s) \sin\theta - \theta, \quad
        g'(\pm\alpha) = 0, \quad \cos\alpha = \frac{1}{1 - s}, \quad s < 0

    A braking wheel that has sunk deep first pushes the soil back, as its rim moves steeply down,
    pulls it forward only below alpha, and pushes back again behind -alpha, where it moves steeply
    up. So there may be a zero between the two, on the falling branch of g, and, where the rim
    touches the soil so far behind the axle, one on the branch behind -alpha. Newton's method
    starts from the cubic that has the extremes of g, whose zeros are
    2 alpha sin([asin(g(theta_1) / g(alpha))] / 3) and the same less a third of a turn. `slip` is
    that of the shear displacement (`braking_law.displacement_slip`); `entry`, `leave` and it have
    shape (batch,), the answers (2, batch).
    References: the shear displacement of Wong and Reece 1967; own derivation.
    """
    xp = namespace(entry)
    m = 1.0 - slip
    # the half angle keeps all digits at small slip, where arccos loses them
    braking = xp.maximum(-slip, xp.full_like(slip, 1e-300))
    turning = 2.0 * xp.asin(xp.sqrt(0.5 * braking / m))
    level, most = m * xp.sin(entry) - entry, m * xp.sin(turning) - turning
    height = level / xp.maximum(most, xp.full_like(most, 1e-300))
    whole = xp.full_like(height, 1.0 - 1e-15)
    third = xp.asin(xp.minimum(xp.maximum(height, -whole), whole)) / 3.0
    angle = 2.0 * turning * xp.sin(xp.stack([third, -math.pi / 3.0 - third], axis=0))
    for _ in range(STEPS):
        rate = m * xp.cos(angle) - 1.0
        step = (m * xp.sin(angle) - angle - level) / xp.where(rate == 0, 1.0 + 0.0 * rate, rate)
        angle = angle - step
    reached = (slip < 0) & (xp.abs(height) < 1.0) & (angle > leave) & (angle < entry)
    return angle, reached & xp.stack([entry > turning, leave < -turning], axis=0)
