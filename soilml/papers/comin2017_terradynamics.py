"""The numbers that Comin and Saaj 2017 print on walking by resistive-force theory, computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.gait_metrics import (
    FeetComparison,
    GaitMetrics,
    compare_feet,
    compare_legs,
    decreasing_until,
    gait_metrics,
)
from soilml.systems.wheel_legs.geometry import WheelLeg, wheel_leg
from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround, stress_gains
from soilml.systems.wheel_legs.walk import walk

#: Ground for the comparison of numbers of legs: the middle of the paper's range; not printed.
MIDDLE = LinearGround(stiffness=0.7e6)


#: What the paper leaves open of legs and body: as assumed, and other readings of it.
OPEN_CHOICES: dict[str, dict[str, Any]] = {
    "as assumed": {},
    "legs bent forwards": {"leg": replace(WheelLeg().leg, arc=-WheelLeg().leg.arc)},
    "body 5 cm below the hub": {"clearance": 0.05},
}


@cache
def _legs(choice: str = "as assumed") -> GaitMetrics:
    return compare_legs(MIDDLE, **OPEN_CHOICES[choice])


@cache
def _feet(choice: str = "as assumed") -> FeetComparison:
    return compare_feet(**OPEN_CHOICES[choice])


#: Stiffness of a soil poured loose, raked and vibrated, relative to the raked state; the paper
#: prints the raked state only, the other two are assumed.
STATES = (0.5, 1.0, 2.0)


@cache
def _sinkage_fit() -> dict[str, float]:
    """s_sigma, s_I and s_Z of eq. 29 and their R^2: walks on the four soils in three states.

    The normal stress on the plates is proportional to the depth (eq. 4), without sigma_0.
    """
    grounds = [
        replace(ground, stiffness=share * ground.stiffness, offset=share * ground.offset)
        for ground in GROUNDS.values()
        for share in STATES
    ]
    walked = gait_metrics(walk(wheel_leg(), [replace(ground, offset=0.0) for ground in grounds]))
    sigma = np.asarray([ground.normal_stiffness for ground in grounds])
    angle = np.asarray([ground.friction_angle for ground in grounds])
    read = np.isfinite(walked.midstance_sinkage)
    z, sigma, angle = walked.midstance_sinkage[read], sigma[read], angle[read]
    s_z, s_i = np.polyfit(z, angle, 1)
    s_sigma = float(np.sum(sigma / z) / np.sum(1.0 / z**2))
    r2 = 1.0 - np.var(angle - s_i - s_z * z) / np.var(angle)
    left = np.sum((sigma - s_sigma / z) ** 2) / np.sum((sigma - sigma.mean()) ** 2)
    return {
        "s_sigma": s_sigma / 100.0,
        "s_sigma_r2": 1.0 - float(left),
        "s_i": float(s_i),
        "s_z": float(s_z) / 100.0,
        "s_phi_r2": float(r2),
    }


def _rank(name: str, foot: str, choice: str = "as assumed") -> float:
    """Rank of a foot by `sinkage` or `slip`, 1 for the lowest; NaN if grounds disagree."""
    feet = _feet(choice)
    ranks = 1 + np.argsort(np.argsort(getattr(feet, name), axis=0), axis=0)[feet.feet.index(foot)]
    return float(ranks[0]) if np.ptp(ranks) == 0 else float("nan")


def _slope_rank(name: str, foot: str, choice: str = "as assumed", errors: float = 0.0) -> float:
    """Rank of a foot by the slope of its values over stiffness, 1 for the steepest.

    `errors` moves its slope by so many standard errors of the line.
    """
    feet = _feet(choice)
    slope, error = feet.sensitivity(getattr(feet, name))
    own = feet.feet.index(foot)
    slope[own] += errors * error[own]
    return float(1 + np.argsort(np.argsort(slope))[own])


def _less_sunk_of_six(choice: str = "as assumed") -> float:
    return 5 + int(np.argmin(_legs(choice).rms_sinkage[4:]))


def _slip_to_five(choice: str = "as assumed") -> float:
    return decreasing_until(_legs(choice).rms_slip[:5]) - 1


#: Quantity and foot of each rank, by key.
RANKS = {
    f"rank_{name}_{foot.lower()}": (name, foot)
    for name in ("sinkage", "slip")
    for foot in ("none", "CIF")
}
SLOPE_RANKS = {
    f"rank_{name}_slope_{foot.lower()}": (name, foot)
    for name, feet in (("sinkage", ("LTF", "CIF")), ("slip", ("none", "LTF", "CIF")))
    for foot in feet
}

#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    "alpha_z_flat": lambda: float(stress_gains(0.0, 0.5 * np.pi)[1]),
    "alpha_x_flat": lambda: float(stress_gains(0.0, 0.5 * np.pi)[0]),
    "rms_slip_legs": lambda: decreasing_until(_legs().rms_slip),
    "rms_slip_to_five": _slip_to_five,
    "rms_sinkage_legs": lambda: decreasing_until(-_legs().rms_sinkage),
    "max_sinkage_drop": lambda: 2 + int(np.argmax(_drop() >= 0.05)),
    "rms_sinkage_six": _less_sunk_of_six,
    "max_sinkage_six": lambda: 5 + int(np.argmin(_legs().max_sinkage[4:])),
    **{key: partial(_rank, *own) for key, own in RANKS.items()},
    **{key: partial(_slope_rank, *own) for key, own in SLOPE_RANKS.items()},
    **{
        key: partial(lambda key: _sinkage_fit()[key], key)
        for key in ("s_sigma", "s_sigma_r2", "s_i", "s_z", "s_phi_r2")
    },
}


def _drop() -> Array:
    """Relative decrease of the maximum sinkage by each additional leg."""
    largest = _legs().max_sinkage
    return 1.0 - largest[1:] / largest[:-1]


def _alternatives(compute: Callable[..., float], *own: str) -> tuple[Callable[[], float], ...]:
    """A number by each of the other readings of `OPEN_CHOICES`."""
    return tuple(partial(compute, *own, choice) for choice in list(OPEN_CHOICES)[1:])


#: By key: the same number by the other open choices; a rank by a slope also within its error.
ALTERNATIVES: dict[str, tuple[Callable[[], float], ...]] = {
    "rms_slip_to_five": _alternatives(_slip_to_five),
    "rms_sinkage_six": _alternatives(_less_sunk_of_six),
    **{key: _alternatives(_rank, *own) for key, own in RANKS.items()},
    **{
        key: (
            *_alternatives(_slope_rank, *own),
            *(partial(_slope_rank, *own, errors=errors) for errors in (-1.0, 1.0)),
        )
        for key, own in SLOPE_RANKS.items()
    },
}
