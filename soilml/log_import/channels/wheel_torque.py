"""Torque at the wheel, from the current of its motor or from a sensor before the gearbox."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.log_import.channels.wheel_load import Constants


def torque_from_current(current: Any, turning: Any, constant: Constants) -> Any:
    r"""Torque (...) at the wheel from the current of its motor (...), A.

    .. math:: T = \eta G k_t (I - I_0)

    while the motor drives. While the wheel drives the motor, the losses of the gearbox come in
    addition: :math:`T = G k_t (I - I_0) / \eta`. `turning` is the sign of the rotation; the idle
    current I_0 opposes it.
    """
    motor = constant("motor_current.torque_constant") * (
        current - np.sign(turning) * constant("motor_current.idle_current")
    )
    return through_gearbox(motor, turning, "motor_current", constant)


def through_gearbox(motor: Any, turning: Any, role: str, constant: Constants) -> Any:
    """Torque (...) at the wheel of a torque at the motor (...), N m."""
    ratio, efficiency = constant(f"{role}.gear_ratio"), constant(f"{role}.efficiency")
    drives = np.asarray(motor) * np.sign(turning) >= 0.0
    return ratio * np.where(drives, efficiency, 1.0 / efficiency) * motor
