"""Friction angle and normal stiffness of a soil from slip and torque or vibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.systems.wheel_legs.slip_models import (
    GRAVITY,
    TORQUE_SLIP,
    VIBRATION_SLIP,
    TorqueSlip,
    VibrationSlip,
    find_slip_model,
    spring_soil,
)
from soilml.systems.wheel_legs.soil_errors import SoilErrors

MIN_RANGE = 1.0  # Smallest range of slips for a regression, in standard deviations of the slip
MAX_EXCESS = 3.0  # Standard deviations from the physical range at which an estimate is refused


@dataclass(frozen=True)
class LegSoil:
    """Friction angle (rad) and normal stiffness sigma_1 (Pa) of one soil, with their covariance.

    `covariance` (2, 2) includes the residual scatter of the slip model and the sensor noise, which
    more strides lessen, and `shared`, the error that all strides on a soil have in common: that of
    the model on soils that were known. It is too small for another wheel-leg, and for a model
    whose errors on known soils are not stated.
    """

    friction_angle: float
    normal_stiffness: float
    covariance: Floats
    shared: Floats

    @property
    def std(self) -> Floats:
        """Standard deviations of friction angle (rad) and normal stiffness (Pa)."""
        return np.sqrt(np.diag(self.covariance))


def soil_from_torque(
    torque: Floats, slip: Floats, model: str | TorqueSlip = "simplified", torque_std: float = 0.0
) -> LegSoil:
    """Estimate the soil from torques at midstance and slips, one pair per stance.

    Parameters
    ----------
    torque
        Motor torque, N m (pairs,).
    slip
        Slip (pairs,).
    model
        Name in `TORQUE_SLIP`, or a model. `simplified` needs one pair, the others two or more with
        different slips.
    torque_std
        Standard deviation of the torque, N m.

    Raises
    ------
    InputError
        For invalid pairs or an unknown model.
    FitError
        If the pairs do not determine the soil, or the estimate is not physical.

    References
    ----------
    Comin and Saaj 2017, eq. 27.

    Examples
    --------
    >>> found = soil_from_torque(1.1, 0.25)
    >>> [round(float(np.rad2deg(v))) for v in (found.friction_angle, found.std[0])]  # degrees
    [40, 6]
    """
    law = find_slip_model(model, TORQUE_SLIP)
    torque, slip = _check_pairs(torque, slip, "torque", torque_std)
    if law.intercept is None:
        a, b, covariance = _line(torque, slip, law.slip_std, torque_std, "simplified")
    else:
        if np.any(torque == 0.0):
            raise FitError("a torque of zero does not determine the soil; leave that pair out")
        noise = np.hypot(law.slip_std, (slip - law.intercept) / torque * torque_std) / torque
        b, var = _weighted_mean((slip - law.intercept) / torque, noise)
        a, covariance = law.intercept, np.diag([0.0, var])
    angle, stiffness = law.soil(a, b)
    jacobian = np.asarray([law.friction[:0:-1], np.asarray(law.stiffness[:0:-1]) * 1e4])
    of_strides = jacobian @ covariance @ jacobian.T
    return _checked(float(angle), float(stiffness), of_strides, law.soil_errors)


def soil_from_vibration(
    vibration: Floats,
    slip: Floats,
    model: str | VibrationSlip = "linear",
    vibration_std: float = 0.0,
) -> LegSoil:
    """Estimate the soil from vibrations after midstance (m/s^2) and slips, one pair per stance.

    The linear model needs one pair, the planar one two or more with different slips. Errors as
    `soil_from_torque`. References: Comin and Saaj 2017, eqs. 27 and 28.
    """
    law = find_slip_model(model, VIBRATION_SLIP)
    vibration, slip = _check_pairs(vibration, slip, "vibration", vibration_std)
    if law.assumed is None:
        a, b, covariance = _line(vibration, slip, law.slip_std, vibration_std, "linear")
        coefficients = np.asarray([a, b])

        def soil_of(line: Floats) -> Floats:
            return np.asarray(spring_soil(*law.spring(line[0], line[1])))
    else:
        in_g = vibration / GRAVITY
        rate = np.deg2rad(1.0 / (law.c_mu + law.b_mu * in_g))
        drops = law.drop(vibration, slip)
        slope = (law.a_mu + law.b_mu * np.rad2deg(drops)) / GRAVITY
        drop, var = _weighted_mean(
            drops, np.abs(rate) * np.hypot(law.slip_std, slope * vibration_std)
        )
        coefficients, covariance = np.asarray([drop]), np.asarray([[var]])

        def soil_of(line: Floats) -> Floats:
            return np.asarray(spring_soil(line[0], law.assumed or 0.0))

    value = soil_of(coefficients)
    jacobian = np.column_stack(
        [soil_of(coefficients + step) - value for step in np.eye(len(coefficients))]
    )
    of_strides = jacobian @ covariance @ jacobian.T
    return _checked(float(value[0]), float(value[1]), of_strides, law.soil_errors)


def _check_pairs(reading: Floats, slip: Floats, name: str, std: float) -> tuple[Floats, Floats]:
    reading, slip = (
        np.atleast_1d(np.asarray(reading, float)),
        np.atleast_1d(np.asarray(slip, float)),
    )
    if reading.ndim != 1 or reading.shape != slip.shape or reading.size == 0:
        raise InputError(
            f"{reading.size} values of {name} and {slip.size} slips are given; needed are pairs"
        )
    if not (np.isfinite(reading).all() and np.isfinite(slip).all()):
        raise InputError(f"a {name} or a slip is not a number; leave that pair out")
    if np.abs(slip).max() > 1.0:
        raise InputError(
            f"slip is {slip[np.abs(slip).argmax()]:g}; it must lie between -1 and 1 (a fraction, "
            "not percent)"
        )
    if not 0.0 <= std < np.inf:
        raise InputError(f"{name}_std is {std:g}; needed is a standard deviation, 0 or more")
    return reading, slip


def _checked(
    angle: float, stiffness: float, of_strides: Floats, errors: SoilErrors | None
) -> LegSoil:
    """The estimate with the errors that strides share.

    Raises `FitError` if it is not physical within the errors of its strides.
    """
    shared = np.zeros((2, 2)) if errors is None else errors.covariance(angle, stiffness)
    estimate = LegSoil(angle, stiffness, of_strides + shared, shared)
    angle_margin, stiffness_margin = MAX_EXCESS * np.sqrt(np.diag(of_strides))
    if not -angle_margin <= angle <= 0.5 * np.pi + angle_margin or stiffness < -stiffness_margin:
        raise FitError(
            f"these pairs give a friction angle of {angle:.3g} rad and a stiffness of "
            f"{stiffness:.3g} Pa, which is not physical: the model is not valid for them"
        )
    return estimate


def _line(
    reading: Floats, slip: Floats, slip_std: float, reading_std: float, single: str
) -> tuple[float, float, Floats]:
    """Regress slip on a reading: intercept, slope and their covariance, with errors in both."""
    if slip.size < 2:
        raise FitError(
            f"1 pair is given; this model needs two or more with different slips; the {single} "
            "model needs one"
        )
    if np.ptp(slip) < MIN_RANGE * slip_std or np.ptp(reading) == 0.0:
        raise FitError(
            f"the slips have a range of {np.ptp(slip):.3g}; this model has an error of "
            f"{slip_std:.2g} and needs {MIN_RANGE * slip_std:.2g} or more; the {single} "
            "model needs no range"
        )
    design = np.column_stack([np.ones_like(reading), reading])
    (a, b), *_ = np.linalg.lstsq(design, slip, rcond=None)
    noise = slip_std**2 + (b * reading_std) ** 2
    return float(a), float(b), noise * np.linalg.inv(design.T @ design)


def _weighted_mean(value: Floats, std: Floats) -> tuple[float, float]:
    information = std**-2.0
    return float((value * information).sum() / information.sum()), float(1.0 / information.sum())
