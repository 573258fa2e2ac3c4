"""Where the shear displacement under a braking wheel changes its direction."""

from __future__ import annotations

from soilml.arrays import Array, namespace

STEPS = 7


def reversal(entry: Array, leave: Array, slip: Array) -> tuple[Array, Array]:
    r"""The angle (rad) at which shear displacement is back at zero, and whether there is one.

    .. math::
        \theta_1 - \theta = (1 - s) (\sin\theta_1 - \sin\theta), \quad s < 0

    A braking wheel that has sunk deep first pushes the soil back, as its rim moves steeply down,
    and pulls it forward only further down. Newton's method from the right-hand side of the single
    hump of the displacement, where it converges monotonically. Arrays of shape (batch,).
    References: the shear displacement of Wong and Reece 1967; own derivation.
    """
    xp = namespace(entry)
    m = 1.0 - slip
    turning = xp.acos(
        xp.minimum(1.0 / m, xp.ones_like(m))
    )  # where the rim neither pushes nor pulls
    end = entry - leave

    def displaced(passed: Array) -> Array:
        return passed - m * (xp.sin(entry) - xp.sin(entry - passed))

    turns = (slip < 0) & (entry > turning) & (displaced(end) < 0)
    top = xp.where(turns, entry - turning, xp.zeros_like(end))
    passed = xp.where(turns, xp.minimum(2.0 * top, end), 0.5 * end)
    for _ in range(STEPS):
        rate = 1.0 - m * xp.cos(entry - passed)
        step = displaced(passed) / xp.where(rate < 0, rate, -xp.ones_like(rate))
        passed = xp.where(turns, xp.minimum(xp.maximum(passed - step, top), end), passed)
    return entry - passed, turns
