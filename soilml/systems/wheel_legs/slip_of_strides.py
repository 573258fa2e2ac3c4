"""Slip of the strides of a wheel-leg on a known soil, by torque, by vibration, and fused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.fusion_rules import inverse_variance
from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    find_slip_model,
    soil_spring,
)

LOWEST, HIGHEST = 0.0, 0.5  # Slips of the tests that the relations come from


@dataclass(frozen=True)
class StrideSlip:
    """Slip of strides (n,) by each sensor, and fused; NaN where nothing was measured.

    by_sensor, std: By `torque` and `vibration`, (n,) each.
    fused, fused_std: By the variances of both, (n,).
    in_range: Whether the fused slip is one for which the relations were fitted, (n,).
    """

    by_sensor: Mapping[str, Floats]
    std: Mapping[str, Floats]
    fused: Floats
    fused_std: Floats
    in_range: NDArray[np.bool_]


def slip_of_strides(
    readings: Mapping[str, Floats],
    friction_angle: float,
    normal_stiffness: float,
    *,
    torque_model: str = "simplified",
    vibration_model: str = "linear",
    torque_std: float = 0.0,
    vibration_std: float = 0.0,
) -> StrideSlip:
    """Slip by the printed relations on a soil of this angle (rad) and stiffness sigma_1 (Pa).

    Parameters
    ----------
    readings
        `torque` (N m) and `vibration` (m/s^2) of each stride (n,), or one of them; NaN where not
        measured.
    torque_model, vibration_model
        Names in `TORQUE_SLIP` and `VIBRATION_SLIP`.
    torque_std, vibration_std
        Standard deviations of the sensors, N m and m/s^2.

    Raises
    ------
    InputError
        For an unknown model, invalid standard deviations, and where nothing was measured.

    References
    ----------
    Comin and Saaj 2017, eqs. 18, 24, 26 and 28, tables IV to VII. The error of the relations is
    that of table VI, as for independent errors; on another soil or wheel-leg it is larger.

    Examples
    --------
    >>> found = slip_of_strides({"torque": [1.1], "vibration": [2.0]}, 0.6981, 11300.0)
    >>> {name: value.round(2).tolist() for name, value in found.by_sensor.items()}
    {'torque': [0.24], 'vibration': [0.1]}
    >>> found.fused.round(2).tolist(), found.fused_std.round(2).tolist()
    ([0.17], [0.1])
    """
    torque_law = find_slip_model(torque_model, TORQUE_SLIP)
    vibration_law = find_slip_model(vibration_model, VIBRATION_SLIP)
    if not all(0.0 <= std < np.inf for std in (torque_std, vibration_std)):
        raise InputError(
            f"standard deviations of {torque_std:g} N m and {vibration_std:g} m/s^2; needed are 0 "
            "or more"
        )
    drop, stiffness = soil_spring(friction_angle, normal_stiffness)
    lines = {
        "torque": (*torque_law.line(friction_angle, normal_stiffness), torque_law.slip_std),
        "vibration": (*vibration_law.line(drop, stiffness), vibration_law.slip_std),
    }
    noise = {"torque": torque_std, "vibration": vibration_std}
    found, std = {}, {}
    for name, (a, b, error) in lines.items():
        if name in readings and np.isfinite(value := np.asarray(readings[name], float)).any():
            found[name] = np.asarray(a + b * value)
            std[name] = np.where(np.isfinite(value), np.hypot(error, b * noise[name]), np.nan)
    if not found:
        raise InputError("nothing was measured: give torque or vibration of each stride")
    mean, each = (np.stack(list(values.values())) for values in (found, std))
    read = np.isfinite(mean)
    with np.errstate(invalid="ignore"):  # a stride without a reading has no weight: NaN
        both = inverse_variance(np.where(read, mean, 0.0), np.where(read, each, np.inf))
    fused = both.mean
    inside = (fused >= LOWEST) & (fused <= HIGHEST)
    return StrideSlip(found, std, fused, np.where(read.any(axis=0), both.std, np.nan), inside)
