"""The mean stress that force sensors found, over turns and sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.systems.force_sensor_wheel.sensor_model import Floats, Readings, SensingWheel


@dataclass(frozen=True)
class Felt:
    """Mean stress over the sensing area (Pa) against the angle on the rim (rad), (bins,) each.

    `whole` says where every sample of every sensor lay between deadband and saturation, so that
    the mean is one. `saturated` is the share of samples with contact at the sensor's end.
    """

    angle: Floats
    normal: Floats
    whole: NDArray[np.bool_]
    saturated: float


def averaged(readings: Readings, wheel: SensingWheel) -> Felt:
    """The mean over turns and sensors, in bins of one sample's turn.

    References: Nagatani et al. 2009, section IV. Raises `InputError` where nothing was felt, or
    not by as many sensors as the wheel has.
    """
    force = readings.force
    if force.shape[2] != wheel.sensors:
        raise InputError(
            f"readings of {force.shape[2]} sensors; the wheel has {wheel.sensors:g} in a row"
        )
    touched = (force > 0.0) & (force >= wheel.deadband)
    inside = touched & (force < wheel.saturation)
    if not touched.any():
        raise InputError(
            f"readings without contact: every sample lies in the deadband of {wheel.deadband:g} N"
        )
    bins = math.ceil(2.0 * math.pi / wheel.step)
    place = np.minimum((readings.angle.ravel() + math.pi) // wheel.step, bins - 1).astype(int)

    def summed(value: Floats) -> Floats:
        return np.bincount(place, value.ravel(), minlength=bins).astype(np.float64)

    count = np.bincount(place, minlength=bins)
    some = count > 0
    return Felt(
        angle=summed(readings.angle)[some] / count[some],
        normal=summed(np.where(touched, force, 0.0).mean(axis=2))[some] / count[some] / wheel.area,
        whole=summed(inside.all(axis=2).astype(np.float64))[some] == count[some],
        saturated=float((force >= wheel.saturation).sum() / touched.sum()),
    )
