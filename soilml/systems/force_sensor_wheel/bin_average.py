"""Mean normal stress in bins of the angle on the rim, over turns and sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.systems.force_sensor_wheel.sensor_readings import Floats, SensingWheel, SensorReadings


@dataclass(frozen=True)
class BinnedStress:
    """Mean stress over the sensing area (Pa) against the angle on the rim (rad), (bins,) each.

    `in_range` marks the bins in which every sample of every sensor lies between deadband and
    saturation; only there is `normal` an unbiased mean. `saturated_fraction` is the fraction of
    the samples with contact that are at saturation.
    """

    angle: Floats
    normal: Floats
    in_range: NDArray[np.bool_]
    saturated_fraction: float


def bin_stress(readings: SensorReadings, wheel: SensingWheel) -> BinnedStress:
    """Average readings over turns and sensors, in bins as wide as one sampling interval turns.

    Parameters
    ----------
    readings
        Forces (turns, samples, sensors) in N at angles (turns, samples) in rad.
    wheel
        Geometry, sampling, deadband and saturation of the sensors.

    Raises
    ------
    InputError
        If no sample exceeds the deadband, or the number of sensors differs from the wheel's.

    References
    ----------
    Nagatani et al. 2009, section IV.
    """
    force = readings.force
    if force.shape[2] != wheel.sensors:
        raise InputError(
            f"readings of {force.shape[2]} sensors; the wheel has {wheel.sensors:g} in a row"
        )
    contact = (force > 0.0) & (force >= wheel.deadband)
    in_range = contact & (force < wheel.saturation)
    if not contact.any():
        raise InputError(
            f"readings without contact: every sample lies in the deadband of {wheel.deadband:g} N"
        )
    bins = math.ceil(2.0 * math.pi / wheel.step)
    bin_index = np.minimum((readings.angle.ravel() + math.pi) // wheel.step, bins - 1).astype(int)

    def sum_by_bin(value: NDArray[np.float64] | np.float64) -> Floats:
        return np.bincount(bin_index, value.ravel(), minlength=bins).astype(np.float64)

    count = np.bincount(bin_index, minlength=bins)
    occupied = count > 0
    mean_force = np.where(contact, force, 0.0).mean(axis=2)
    all_in_range = in_range.all(axis=2).astype(np.float64)
    return BinnedStress(
        angle=sum_by_bin(readings.angle)[occupied] / count[occupied],
        normal=sum_by_bin(mean_force)[occupied] / count[occupied] / wheel.area,
        in_range=sum_by_bin(all_in_range)[occupied] == count[occupied],
        saturated_fraction=float((force >= wheel.saturation).sum() / contact.sum()),
    )
