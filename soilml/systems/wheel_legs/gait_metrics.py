"""Metrics of a gait, compared over numbers of legs, feet and stiffness of the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from soilml.arrays import Array
from soilml.errors import InputError
from soilml.systems.wheel_legs.geometry import FEET, MAX_LEGS, wheel_leg
from soilml.systems.wheel_legs.resistive_force import LinearGround
from soilml.systems.wheel_legs.walk import Walk, walk

#: Stiffnesses over which the paper compares feet, N/m^3: alpha_z from 0.4 to 1.0 N/cm^3.
STIFFNESSES = (0.4e6, 0.6e6, 0.8e6, 1.0e6)
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class GaitMetrics:
    """Metrics of the last full turn of every case, (cases,); NaN for a case that has stopped."""

    max_sinkage: Array  # m
    rms_sinkage: Array  # m
    mean_sinkage: Array  # m
    rms_slip: Array
    rms_slip_propelled: Array  # over the instants with propulsion, slip below 1
    mean_slip: Array
    mean_torque: Array  # N m
    midstance_sinkage: Array  # m
    status: Array


def gait_metrics(walk_result: Walk) -> GaitMetrics:
    """Metrics of the last full turn of a walk; raises `InputError` if it is shorter than a turn."""
    if walk_result.angle[-1] < TURN - 1e-9:
        raise InputError(
            f"a walk of {walk_result.angle[-1] / TURN:.2g} turns; one full turn or more is needed"
        )
    last = walk_result.after(float(walk_result.angle[-1]) - TURN)
    sinkage, slip = last.sinkage, last.slip
    propelled = slip < 1.0
    return GaitMetrics(
        max_sinkage=sinkage.max(axis=0),
        rms_sinkage=_rms(sinkage),
        mean_sinkage=sinkage.mean(axis=0),
        rms_slip=_rms(slip),
        rms_slip_propelled=np.sqrt(
            np.sum(np.where(slip >= 1.0, 0.0, slip) ** 2, axis=0) / np.maximum(propelled.sum(0), 1)
        ),
        mean_slip=slip.mean(axis=0),
        mean_torque=last.torque.mean(axis=0),
        midstance_sinkage=last.at_midstance(sinkage),
        status=last.status,
    )


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0))


def compare_legs(ground: LinearGround, turns: float = 2.0, **changes: Any) -> GaitMetrics:
    """1 to `MAX_LEGS` legs without feet on one ground (Comin and Saaj 2017, fig. 5); (legs,).

    `changes` replace fields of the `WheelLeg`.
    """
    wheels = [wheel_leg("none", legs=n + 1, **changes) for n in range(MAX_LEGS)]
    return gait_metrics(walk(wheels, ground, turns=turns))


@dataclass(frozen=True)
class FeetComparison:
    """Sinkage (m) and slip of feet over the ground's stiffness (Comin and Saaj 2017, fig. 6).

    `sinkage`, `slip`, `rms_slip`: (feet, stiffnesses), means over a turn, the last a root mean
    square.
    """

    feet: tuple[str, ...]
    stiffness: Array  # N/m^3
    sinkage: Array
    slip: Array
    rms_slip: Array
    status: Array

    def sensitivity(self, values: Array) -> tuple[Array, Array]:
        """Least-squares slope of values over stiffness, per N/m^3, and its std error, (feet,)."""
        centred = self.stiffness - self.stiffness.mean()
        spread = np.sum(centred**2)
        slope = values @ centred / spread
        residual = values - values.mean(axis=1, keepdims=True) - slope[:, None] * centred
        return slope, np.sqrt(np.sum(residual**2, axis=1) / (centred.size - 2) / spread)


def compare_feet(
    stiffnesses: Sequence[float] = STIFFNESSES, feet: Sequence[str] = tuple(FEET), **changes: Any
) -> FeetComparison:
    """Five legs with each of the feet, rolling freely on each of three or more grounds.

    `changes` replace fields of the `WheelLeg`.
    """
    cases = list(product(feet, stiffnesses))
    wheels = [wheel_leg(foot, **changes) for foot, _ in cases]
    found = gait_metrics(walk(wheels, [LinearGround(stiffness=alpha) for _, alpha in cases]))
    shape = (len(feet), len(stiffnesses))
    return FeetComparison(
        feet=tuple(feet),
        stiffness=np.array(stiffnesses, float),
        sinkage=found.mean_sinkage.reshape(shape),
        slip=found.mean_slip.reshape(shape),
        rms_slip=found.rms_slip.reshape(shape),
        status=found.status.reshape(shape),
    )


def decreasing_until(values: Array, least: float = 0.0) -> int:
    """Number of leading entries each of which is lower than the previous one.

    Lower by more than the fraction `least`; 1 if the second entry is not lower.
    """
    falls = values[1:] < values[:-1] * (1.0 - least)
    return 1 + (int(np.argmin(falls)) if not np.all(falls) else falls.size)
