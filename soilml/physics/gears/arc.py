"""Angles of a circle that has sunk into the soil, without loss of digits at small sinkage."""

from __future__ import annotations

from soilml.arrays import Array, Real, namespace


def entry_angle(sinkage: Array, radius: Real) -> Array:
    r"""Angle (rad) from straight down at which a circle meets the surface.

    .. math:: \theta_1 = \arccos(1 - z / r) = 2 \arcsin\sqrt{z / (2 r)}

    The second form keeps all digits at small sinkage, where arccos loses them.
    """
    xp = namespace(sinkage)
    return 2.0 * xp.asin(xp.sqrt(sinkage / (2.0 * radius)))


def differences_from_entry(
    sin_entry: Array, cos_entry: Array, passed: Array
) -> tuple[Array, Array]:
    r"""Differences of sine and cosine between the entry angle and a point of the arc.

    .. math::
        \sin\theta_1 - \sin\theta = u (\cos\theta_1 + t \sin\theta_1), \quad
        \cos\theta - \cos\theta_1 = u (\sin\theta_1 - t \cos\theta_1), \quad
        t = \tan\frac{\theta_1 - \theta}{2}, \quad u = \frac{2 t}{1 + t^2}

    so that nothing cancels close to the entry. `passed` (rad) is the angle passed since entry,
    theta_1 - theta; the sine and cosine of theta_1 broadcast against it.
    """
    xp = namespace(passed)
    t = xp.tan(0.5 * passed)
    u = 2.0 * t / (1.0 + t * t)
    return u * (cos_entry + t * sin_entry), u * (sin_entry - t * cos_entry)
