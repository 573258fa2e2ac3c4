"""Soil from the strides of a wheel-leg by each of its sensors, and fused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.onboard.fusion_rules import pairwise
from soilml.systems.wheel_legs.sinkage_fit import PRINTED_SINKAGE, SinkageFit
from soilml.systems.wheel_legs.slip_models import TORQUE_SLIP, VIBRATION_SLIP, find_slip_model
from soilml.systems.wheel_legs.soil_errors import SINKAGE, SoilErrors, correlation_of
from soilml.systems.wheel_legs.soil_from_slip import LegSoil, soil_from_torque, soil_from_vibration


@dataclass(frozen=True)
class StrideSoil:
    """Friction angle (rad) and normal stiffness (Pa) of one soil by each sensor, and fused.

    mean, std (sensors, 2): Angle and stiffness, in the order of `sensors`; "fused" is last where
    there are several.
    strides (sensors,): How many rows each sensor has.
    unused: Why a sensor that was read gives no estimate, by sensor.
    in_range: False where the mean sinkage is outside of the range of its relation.
    """

    sensors: tuple[str, ...]
    mean: Floats
    std: Floats
    strides: tuple[int, ...]
    unused: Mapping[str, str]
    in_range: bool


def soil_of_strides(
    slip: Floats,
    readings: Mapping[str, Floats],
    *,
    torque_model: str = "simplified",
    vibration_model: str = "linear",
    torque_std: float = 0.0,
    vibration_std: float = 0.0,
    sinkage_model: SinkageFit = PRINTED_SINKAGE,
) -> StrideSoil:
    """Estimate one soil from slip and torque, vibration and sinkage at midstance.

    Fused with the weights of the paper, which follow from the scatter of its table VIII. The errors
    that all strides on a soil share are correlated between sensors as those of the table are.

    Parameters
    ----------
    slip
        Slip of each stride (n,).
    readings
        `torque` (N m), `vibration` (m/s^2) and `sinkage` (m) of each stride (n,), one or more of
        them; NaN where not measured.
    torque_model, vibration_model
        Names in `TORQUE_SLIP` and `VIBRATION_SLIP`.
    torque_std, vibration_std
        Standard deviations of the sensors, N m and m/s^2.
    sinkage_model
        Relations of the sinkage: the printed ones, or a `SinkageFit` of one's own.

    Raises
    ------
    InputError
        For readings that are not valid, an unknown model, and where nothing was measured.
    FitError
        Where no sensor gives an estimate, with the reasons.

    References
    ----------
    Comin and Saaj 2017, eqs. 27 to 30, tables IV, V and VII.

    Examples
    --------
    >>> found = soil_of_strides([0.25], {"torque": [1.1], "sinkage": [0.012]})
    >>> found.sensors, np.rad2deg(found.mean[:, 0]).round().tolist()
    (('torque', 'sinkage', 'fused'), [40.0, 39.0, 39.0])
    """
    slip = np.atleast_1d(np.asarray(slip, float))
    solve: dict[str, Callable[[Floats, Floats], LegSoil]] = {
        "torque": lambda value, at: soil_from_torque(value, at, torque_model, torque_std),
        "vibration": lambda v, at: soil_from_vibration(v, at, vibration_model, vibration_std),
        "sinkage": lambda value, _: _from_sinkage(value, sinkage_model),
    }
    found: dict[str, LegSoil] = {}
    strides: list[int] = []
    unused: dict[str, str] = {}
    in_range = True
    for sensor in solve:
        if sensor not in readings:
            continue
        value = np.atleast_1d(np.asarray(readings[sensor], float))
        if value.shape != slip.shape:
            raise InputError(
                f"{value.size} values of {sensor} and {slip.size} slips; needed are pairs"
            )
        read = np.isfinite(value)
        if not read.any():
            continue
        try:
            found[sensor] = solve[sensor](value[read], slip[read])
        except FitError as error:
            unused[sensor] = str(error)
            continue
        strides.append(int(read.sum()))
        if sensor == "sinkage":
            in_range = bool(sinkage_model(value[read].mean()).in_range)
    if not found and not unused:
        raise InputError("nothing was measured: give torque, vibration or sinkage of each stride")
    if not found:
        raise FitError("; ".join(f"{sensor}: {why}" for sensor, why in unused.items()))
    mean = np.asarray([(one.friction_angle, one.normal_stiffness) for one in found.values()])
    std = np.stack([one.std for one in found.values()])
    names = tuple(found)
    if len(found) > 1:
        errors = {
            "torque": find_slip_model(torque_model, TORQUE_SLIP).soil_errors,
            "vibration": find_slip_model(vibration_model, VIBRATION_SLIP).soil_errors,
            "sinkage": sinkage_model.soil_errors or SINKAGE,
        }
        one, one_std = _fused(list(found.values()), [errors[sensor] for sensor in found])
        mean, std = np.vstack([mean, one]), np.vstack([std, one_std])
        names, strides = (*names, "fused"), [*strides, max(strides)]
    return StrideSoil(names, mean, std, tuple(strides), unused, in_range)


def _fused(
    estimates: Sequence[LegSoil], errors: Sequence[SoilErrors | None]
) -> tuple[Floats, Floats]:
    """Mean and std (2,) by the weights of eq. 30, whose variances are those of table VIII."""
    known = [one for one in errors if one is not None]
    values = np.asarray([(e.friction_angle, e.normal_stiffness) for e in estimates])
    weights = pairwise(values, np.asarray([one.scatter for one in known])).weights
    variance = np.empty(2)
    for k in range(2):
        total = np.asarray([e.covariance[k, k] for e in estimates])
        shared = np.sqrt([e.shared[k, k] for e in estimates])
        covariance = np.outer(shared, shared) * correlation_of(known, k)
        np.fill_diagonal(covariance, total)
        variance[k] = weights[:, k] @ covariance @ weights[:, k]
    return (weights * values).sum(axis=0), np.sqrt(variance)


def _from_sinkage(sinkage: Floats, relations: SinkageFit) -> LegSoil:
    """By relations whose error is of the soil: more strides do not lessen it."""
    found = relations(sinkage.mean())
    std = np.asarray([found.friction_angle_std, found.normal_stiffness_std])
    shared = np.diag(std.astype(float) ** 2)
    return LegSoil(float(found.friction_angle), float(found.normal_stiffness), shared, shared)
