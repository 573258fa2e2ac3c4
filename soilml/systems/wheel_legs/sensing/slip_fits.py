"""The linear slip models fitted to simulated stances, and how well they fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError
from soilml.systems.wheel_legs.sensing.slip_models import (
    GRAVITY,
    PRESSURE,
    STIFFNESS,
    TorqueSlip,
    VibrationSlip,
)

Floats = NDArray[np.float64]
Law = TypeVar("Law", TorqueSlip, VibrationSlip)


@dataclass(frozen=True)
class Fitted(Generic[Law]):
    """A slip model, and the shares of variance that its parts explain (R^2), by part."""

    law: Law
    goodness: dict[str, float]


def lines(felt: Floats, slip: Floats) -> tuple[Floats, Floats, Floats]:
    """Intercepts, slopes and R^2 (soils,) of slip (slips,) on what is felt (slips, soils)."""
    slips = np.broadcast_to(np.asarray(slip, float)[:, None], felt.shape)
    x, y = felt - felt.mean(axis=0), slips - slips.mean(axis=0)
    with np.errstate(invalid="ignore"):  # what is felt the same at every slip has no line: NaN
        slope = (x * y).sum(axis=0) / (x * x).sum(axis=0)
    left = ((y - slope * x) ** 2).sum(axis=0)
    return (
        slips.mean(axis=0) - slope * felt.mean(axis=0),
        slope,
        1.0 - left / (y * y).sum(axis=0),
    )


def fit_torque_slip(
    torque: Floats, slip: Floats, friction_angle: Floats, normal_stiffness: Floats, form: str
) -> Fitted[TorqueSlip]:
    """Eqs. 18 and 27 fitted to torques (N m), (slips, soils), on soils of known properties (SI).

    `form` says which coefficient is none: `terramechanics` a_sigma, `empirical` a_tau, as printed
    in table IV of Comin and Saaj 2017; four soils leave one degree of freedom.
    """
    a, b, straight = lines(torque, slip)
    _finite(a, b)
    both = form == "terramechanics"
    friction, gof_friction = _plane(friction_angle, b, a if both else None)
    stiffness, gof_stiffness = _plane(normal_stiffness / PRESSURE, b, None if both else a)
    error = np.asarray(slip)[:, None] - a - b * torque
    law = TorqueSlip(friction=friction, stiffness=stiffness, slip_std=float(np.std(error)))
    goodness = {"slip": float(np.median(straight)), "friction": gof_friction}
    return Fitted(law, goodness | {"stiffness": gof_stiffness})


def fit_vibration_slip(
    vibration: Floats, slip: Floats, increment: Floats, stiffness: Floats, planar: bool
) -> Fitted[VibrationSlip]:
    """Eqs. 24 and 25 fitted to vibrations (m/s^2), (slips, springs), of known springs (SI)."""
    a, b, straight = lines(vibration, slip)
    _finite(a, b)
    drop, spring = np.rad2deg(increment), stiffness / STIFFNESS
    (c_i, c_mu, c_k), gof_a = _plane(a, drop, spring if planar else None)
    (a_mu, b_mu, _), gof_b = _plane(b * GRAVITY, drop, None)
    error = np.asarray(slip)[:, None] - a - b * vibration
    law = VibrationSlip(
        c_i=c_i, c_mu=c_mu, c_k=c_k, a_mu=a_mu, b_mu=b_mu, slip_std=float(np.std(error)),
        assumed=None if planar else float(np.mean(stiffness)),
    )  # fmt: skip
    return Fitted(law, {"slip": float(np.median(straight)), "intercept": gof_a, "slope": gof_b})


def _plane(
    y: Floats, first: Floats, second: Floats | None
) -> tuple[tuple[float, float, float], float]:
    """Coefficients of y = c + p first + q second (q = 0 without a second), and R^2."""
    columns = [np.ones_like(first), first] + ([] if second is None else [second])
    found, *_ = np.linalg.lstsq(np.column_stack(columns), y, rcond=None)
    left = y - np.column_stack(columns) @ found
    c, p, q = (*found, 0.0)[:3]
    return (float(c), float(p), float(q)), 1.0 - float(left @ left / np.sum((y - y.mean()) ** 2))


def _finite(a: Floats, b: Floats) -> None:
    bad = ~(np.isfinite(a) & np.isfinite(b))
    if bad.any():
        raise FitError(
            f"{bad.sum()} of {bad.size} soils have no line of slip: a stance without equilibrium, "
            "or one that feels the same at every slip; leave those soils out"
        )
