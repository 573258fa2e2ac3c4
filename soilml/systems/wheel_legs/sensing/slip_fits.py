"""Linear slip models fitted to simulated stances, and their goodness of fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError
from soilml.systems.wheel_legs.slip_models import (
    GRAVITY,
    PRESSURE,
    STIFFNESS,
    TorqueSlip,
    VibrationSlip,
)

Floats = NDArray[np.float64]
Law = TypeVar("Law", TorqueSlip, VibrationSlip)


@dataclass(frozen=True)
class SlipModelFit(Generic[Law]):
    """A fitted slip model, and R^2 of its parts by name."""

    law: Law
    goodness: dict[str, float]


def fit_lines(reading: Floats, slip: Floats) -> tuple[Floats, Floats, Floats]:
    """Regress slip (slips,) on a reading (slips, soils): intercepts, slopes and R^2, (soils,)."""
    slips = np.broadcast_to(np.asarray(slip, float)[:, None], reading.shape)
    x, y = reading - reading.mean(axis=0), slips - slips.mean(axis=0)
    with np.errstate(invalid="ignore"):  # a reading that is equal at all slips has no slope: NaN
        slope = (x * y).sum(axis=0) / (x * x).sum(axis=0)
    residual = ((y - slope * x) ** 2).sum(axis=0)
    return (
        slips.mean(axis=0) - slope * reading.mean(axis=0),
        slope,
        1.0 - residual / (y * y).sum(axis=0),
    )


def fit_torque_slip(
    torque: Floats, slip: Floats, friction_angle: Floats, normal_stiffness: Floats, form: str
) -> SlipModelFit[TorqueSlip]:
    """Fit eqs. 18 and 27 to torques (N m), (slips, soils), on soils of known properties (SI).

    `form` determines which coefficient is zero: a_sigma for `terramechanics`, a_tau for
    `empirical`, as printed in table IV of Comin and Saaj 2017; four soils leave one degree of
    freedom.
    """
    a, b, straight = fit_lines(torque, slip)
    _check_finite(a, b)
    both = form == "terramechanics"
    friction, gof_friction = _plane(friction_angle, b, a if both else None)
    stiffness, gof_stiffness = _plane(normal_stiffness / PRESSURE, b, None if both else a)
    error = np.asarray(slip)[:, None] - a - b * torque
    law = TorqueSlip(friction=friction, stiffness=stiffness, slip_std=float(np.std(error)))
    goodness = {"slip": float(np.median(straight)), "friction": gof_friction}
    return SlipModelFit(law, goodness | {"stiffness": gof_stiffness})


def fit_vibration_slip(
    vibration: Floats, slip: Floats, increment: Floats, stiffness: Floats, planar: bool
) -> SlipModelFit[VibrationSlip]:
    """Fit eqs. 24 and 25 to vibrations (m/s^2), (slips, springs), of known springs (SI)."""
    a, b, straight = fit_lines(vibration, slip)
    _check_finite(a, b)
    drop, spring = np.rad2deg(increment), stiffness / STIFFNESS
    (c_i, c_mu, c_k), gof_a = _plane(a, drop, spring if planar else None)
    (a_mu, b_mu, _), gof_b = _plane(b * GRAVITY, drop, None)
    error = np.asarray(slip)[:, None] - a - b * vibration
    law = VibrationSlip(
        c_i=c_i, c_mu=c_mu, c_k=c_k, a_mu=a_mu, b_mu=b_mu, slip_std=float(np.std(error)),
        assumed=None if planar else float(np.mean(stiffness)),
    )  # fmt: skip
    return SlipModelFit(
        law, {"slip": float(np.median(straight)), "intercept": gof_a, "slope": gof_b}
    )


def _plane(
    y: Floats, first: Floats, second: Floats | None
) -> tuple[tuple[float, float, float], float]:
    """Coefficients of y = c + p first + q second (q = 0 without a second), and R^2."""
    columns = [np.ones_like(first), first] + ([] if second is None else [second])
    coefficients, *_ = np.linalg.lstsq(np.column_stack(columns), y, rcond=None)
    residual = y - np.column_stack(columns) @ coefficients
    c, p, q = (*coefficients, 0.0)[:3]
    return (float(c), float(p), float(q)), 1.0 - float(
        residual @ residual / np.sum((y - y.mean()) ** 2)
    )


def _check_finite(a: Floats, b: Floats) -> None:
    invalid = ~(np.isfinite(a) & np.isfinite(b))
    if invalid.any():
        raise FitError(
            f"{invalid.sum()} of {invalid.size} soils have no slip model: a stance without "
            "equilibrium, or readings that are equal at all slips; leave those soils out"
        )
