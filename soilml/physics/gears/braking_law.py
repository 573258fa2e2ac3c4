"""How the shear displacement under a braking wheel, and the sign of the shear stress, are found."""

from __future__ import annotations

from typing import Literal, get_args

from soilml.arrays import Array, namespace
from soilml.errors import InputError

#: "displacement-sign": shear stress has the sign of the shear displacement, point by point;
#: "slip-sign": it has the sign of the slip all along the rim, as the source papers print it.
BrakingLaw = Literal["displacement-sign", "slip-sign"]


def check_law(law: str) -> None:
    """Raise `InputError` where there is no such law."""
    if law not in get_args(BrakingLaw):
        raise InputError(f"braking is {law!r}; there are: {', '.join(get_args(BrakingLaw))}")


def displacement_slip(slip: Array, law: BrakingLaw) -> Array:
    r"""Slip s' of the shear displacement, of any shape.

    .. math::
        j(\theta) = r [\theta_1 - \theta - (1 - s')(\sin\theta_1 - \sin\theta)], \quad
        1 - s' = \frac{v}{r \omega} = \begin{cases} 1 - s & s \ge 0 \\
        1 / (1 + s) & s < 0 \end{cases}

    By "slip-sign" s' is the slip itself, and 1 - s is the travel ratio of a driving wheel only.
    References: shear displacement as the integral of the slip velocity, Wong and Reece,
    J. Terramechanics 4(1), 1967; definitions of slip, Wong, Theory of Ground Vehicles, chapter 2.
    """
    if law == "slip-sign":
        return slip
    return namespace(slip).where(slip < 0, slip / (1.0 + slip), slip)


def displacement_direction(displacement: Array, slip: Array, law: BrakingLaw) -> Array:
    """Direction of the shear stress, 1 or -1, at points of this shear displacement.

    `displacement` has shape (points, batch) or (batch,), `slip` (batch,); the answer has the shape
    of `slip` where nothing brakes, or where the direction is that of the slip.
    """
    xp = namespace(slip)
    if law == "slip-sign" or not bool(xp.any(slip < 0)):
        return xp.where(slip < 0, -xp.ones_like(slip), xp.ones_like(slip))
    one = xp.ones_like(displacement)
    return xp.where((slip < 0) & (displacement < 0), -one, one)
