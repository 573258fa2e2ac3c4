"""Friction angle and normal stiffness of a soil from what a wheel-leg feels while it slips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError, InputError
from soilml.systems.wheel_legs.sensing.slip_models import (
    GRAVITY,
    TORQUE_SLIP,
    VIBRATION_SLIP,
    TorqueSlip,
    VibrationSlip,
    spring_soil,
)

Floats = NDArray[np.float64]

#: The slips of a line must spread by this much, in standard deviations of one of them.
SPREAD = 1.0
#: An answer so many standard deviations from any soil is none.
FAR = 3.0

Law = TypeVar("Law", TorqueSlip, VibrationSlip)


@dataclass(frozen=True)
class LegSoil:
    """Friction angle (rad) and normal stiffness sigma_1 (Pa) of one soil, with their errors.

    `covariance` (2, 2) carries the scatter of the model's slip and the sensors' noise, not the
    error of the model's own coefficients: on another soil than those it was fitted to, and on
    another wheel-leg, it is too small.
    """

    friction_angle: float
    normal_stiffness: float
    covariance: Floats

    @property
    def std(self) -> Floats:
        """Standard deviations of friction angle (rad) and normal stiffness (Pa)."""
        return np.sqrt(np.diag(self.covariance))


def from_torque(
    torque: Floats, slip: Floats, model: str | TorqueSlip = "simplified", torque_std: float = 0.0
) -> LegSoil:
    """The soil from torques in midstance (N m) and slips, one pair for each stance, (pairs,).

    The simplified model answers for one pair, the others for two or more of spread slip.
    References: Comin and Saaj 2017, eq. 27. Raises `FitError` where the pairs cannot tell.
    """
    law = _named(model, TORQUE_SLIP)
    torque, slip = _pairs(torque, slip, "torque", torque_std)
    if law.intercept is None:
        a, b, covariance = _line(torque, slip, law.slip_std, torque_std, "simplified")
    else:
        if np.any(torque == 0.0):
            raise FitError("a torque of zero tells nothing of the soil; leave that pair out")
        noise = np.hypot(law.slip_std, (slip - law.intercept) / torque * torque_std) / torque
        b, var = _weighed((slip - law.intercept) / torque, noise)
        a, covariance = law.intercept, np.diag([0.0, var])
    angle, stiffness = law.soil(a, b)
    turn = np.asarray([law.friction[:0:-1], np.asarray(law.stiffness[:0:-1]) * 1e4])
    return _possible(LegSoil(float(angle), float(stiffness), turn @ covariance @ turn.T))


def from_vibration(
    vibration: Floats,
    slip: Floats,
    model: str | VibrationSlip = "linear",
    vibration_std: float = 0.0,
) -> LegSoil:
    """The soil from vibrations after midstance (m/s^2) and slips, one pair for each stance.

    The linear model answers for one pair, the planar one for two or more of spread slip.
    References: Comin and Saaj 2017, eqs. 27 and 28. Raises `FitError` where the pairs cannot tell.
    """
    law = _named(model, VIBRATION_SLIP)
    vibration, slip = _pairs(vibration, slip, "vibration", vibration_std)
    if law.assumed is None:
        a, b, covariance = _line(vibration, slip, law.slip_std, vibration_std, "linear")
        found = np.asarray([a, b])

        def of_line(line: Floats) -> Floats:
            return np.asarray(spring_soil(*law.spring(line[0], line[1])))
    else:
        shaken = vibration / GRAVITY
        rate = np.deg2rad(1.0 / (law.c_mu + law.b_mu * shaken))
        drops = law.drop(vibration, slip)
        slope = (law.a_mu + law.b_mu * np.rad2deg(drops)) / GRAVITY
        drop, var = _weighed(drops, np.abs(rate) * np.hypot(law.slip_std, slope * vibration_std))
        found, covariance = np.asarray([drop]), np.asarray([[var]])

        def of_line(line: Floats) -> Floats:
            return np.asarray(spring_soil(line[0], law.assumed or 0.0))

    value = of_line(found)
    turn = np.column_stack([of_line(found + step) - value for step in np.eye(len(found))])
    return _possible(LegSoil(float(value[0]), float(value[1]), turn @ covariance @ turn.T))


def _named(model: str | Law, catalogue: Mapping[str, Law]) -> Law:
    if not isinstance(model, str):
        return model
    if model not in catalogue:
        raise InputError(f"no slip model {model!r}; there are: {', '.join(catalogue)}")
    return catalogue[model]


def _pairs(felt: Floats, slip: Floats, name: str, std: float) -> tuple[Floats, Floats]:
    felt, slip = np.atleast_1d(np.asarray(felt, float)), np.atleast_1d(np.asarray(slip, float))
    if felt.ndim != 1 or felt.shape != slip.shape or felt.size == 0:
        raise InputError(
            f"{felt.size} values of {name} and {slip.size} slips are given; a pair is one of each"
        )
    if not (np.isfinite(felt).all() and np.isfinite(slip).all()):
        raise InputError(f"a {name} or a slip is not a number; leave that pair out")
    if np.abs(slip).max() > 1.0:
        raise InputError(
            f"slip is {slip[np.abs(slip).argmax()]:g}; it must lie between -1 and 1, a share and "
            "not in percent"
        )
    if not 0.0 <= std < np.inf:
        raise InputError(f"{name}_std is {std:g}; needed is a standard deviation, 0 or more")
    return felt, slip


def _possible(found: LegSoil) -> LegSoil:
    """The same; `FitError` where no soil lies within its errors: lines go on where soils end."""
    angle, stiffness = found.friction_angle, found.normal_stiffness
    angle_far, stiffness_far = FAR * found.std
    if not -angle_far <= angle <= 0.5 * np.pi + angle_far or stiffness < -stiffness_far:
        raise FitError(
            f"these pairs give a friction angle of {angle:.3g} rad and a stiffness of "
            f"{stiffness:.3g} Pa, which no soil has: the model does not hold for them"
        )
    return found


def _line(
    felt: Floats, slip: Floats, slip_std: float, felt_std: float, single: str
) -> tuple[float, float, Floats]:
    """Intercept, slope and their covariance of slip on what is felt; errors of both carried."""
    if slip.size < 2:
        raise FitError(
            f"1 pair is given; this model needs two or more of different slip; the {single} model "
            "takes one"
        )
    if np.ptp(slip) < SPREAD * slip_std or np.ptp(felt) == 0.0:
        raise FitError(
            f"the slips spread by {np.ptp(slip):.3g}; this model errs by {slip_std:.2g} and needs "
            f"{SPREAD * slip_std:.2g} or more; the {single} model needs no spread"
        )
    design = np.column_stack([np.ones_like(felt), felt])
    (a, b), *_ = np.linalg.lstsq(design, slip, rcond=None)
    noise = slip_std**2 + (b * felt_std) ** 2
    return float(a), float(b), noise * np.linalg.inv(design.T @ design)


def _weighed(value: Floats, std: Floats) -> tuple[float, float]:
    information = std**-2.0
    return float((value * information).sum() / information.sum()), float(1.0 / information.sum())
