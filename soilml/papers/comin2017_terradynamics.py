"""The numbers that Comin and Saaj 2017 print on walking by resistive-force theory, computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from soilml.arrays import Array, Floats
from soilml.systems.wheel_legs.resistive_force import (
    FEET,
    GROUNDS,
    MAX_LEGS,
    LinearGround,
    WheelLeg,
    resistance_terms,
    wheel_leg,
)
from soilml.systems.wheel_legs.walk import gait_metrics, walk

#: Stiffnesses over which the paper compares feet, alpha_z from 0.4 to 1.0 N/cm^3, and the ground
#: for the comparison of numbers of legs, the middle of that range, which is not printed; N/m^3.
STIFFNESSES, MIDDLE = (0.4e6, 0.6e6, 0.8e6, 1.0e6), 0.7e6
#: What the paper leaves open of legs and body: as assumed, and other readings of it.
OPEN_CHOICES: dict[str, dict[str, Any]] = {
    "as assumed": {},
    "legs bent forwards": {"leg": replace(WheelLeg().leg, arc=-WheelLeg().leg.arc)},
    "body 5 cm below the hub": {"clearance": 0.05},
}
#: Stiffness of a soil poured loose, raked and vibrated, relative to the raked state; the paper
#: prints the raked state only, the other two are assumed.
STATES = (0.5, 1.0, 2.0)


@cache
def _walked() -> dict[tuple[str, str], dict[str, Array]]:
    """Metrics of all walks, by choice and group, which one batch takes no longer for than each.

    Groups: 1 to 6 `legs` without feet, fig. 5; `feet` on each of the stiffnesses, fig. 6; `soils`
    of the four names in three states, on which eq. 29 is fitted.
    """
    cases: dict[tuple[str, str], list[tuple[WheelLeg, LinearGround]]] = {}
    for choice, changes in OPEN_CHOICES.items():
        middle = LinearGround(stiffness=MIDDLE)
        counts = range(1, MAX_LEGS + 1)
        cases[choice, "legs"] = [(wheel_leg("none", legs=n, **changes), middle) for n in counts]
        cases[choice, "feet"] = [
            (wheel_leg(foot, **changes), LinearGround(stiffness=alpha))
            for foot in FEET
            for alpha in STIFFNESSES
        ]
    cases["as assumed", "soils"] = [(wheel_leg(), ground) for ground in _soils()]
    legs, grounds = zip(*(case for group in cases.values() for case in group), strict=True)
    found, first, metrics = {}, 0, gait_metrics(walk(legs, grounds))
    for group, own in cases.items():
        found[group] = {name: v[first : first + len(own)] for name, v in metrics.items()}
        first += len(own)
    return found


def _soils() -> list[LinearGround]:
    return [
        replace(ground, stiffness=share * ground.stiffness, offset=share * ground.offset)
        for ground in GROUNDS.values()
        for share in STATES
    ]


def _legs(name: str, choice: str = "as assumed") -> Array:
    """A metric of 1 to 6 legs, (6,)."""
    return _walked()[choice, "legs"][name]


def _feet(name: str, choice: str = "as assumed") -> Array:
    """A metric of the four feet over the stiffnesses, (feet, stiffnesses)."""
    return _walked()[choice, "feet"][name].reshape(len(FEET), len(STIFFNESSES))


def _lower(values: Array) -> int:
    """Number of leading entries each of which is lower than the previous one."""
    falls = np.append(values[1:] < values[:-1], False)
    return 1 + int(np.argmin(falls))


def _sinkage_fit(number: str) -> float:
    """s_sigma, s_I or s_Z of eq. 29 or their R^2: walks on the four soils in three states.

    The normal stress on the plates is proportional to the depth (eq. 4), without sigma_0.
    """
    grounds, sunk = _soils(), _walked()["as assumed", "soils"]["sinkage_midstance_m"]
    read = np.isfinite(sunk)
    z = sunk[read]
    sigma = np.asarray([ground.normal_stiffness for ground in grounds])[read]
    angle = np.asarray([ground.friction_angle for ground in grounds])[read]
    s_z, s_i = np.polyfit(z, angle, 1)
    s_sigma = float(np.sum(sigma / z) / np.sum(1.0 / z**2))
    return {
        "s_sigma": s_sigma / 100.0,
        "s_sigma_r2": 1.0 - _left(sigma, s_sigma / z),
        "s_i": float(s_i),
        "s_z": float(s_z) / 100.0,
        "s_phi_r2": 1.0 - _left(angle, s_i + s_z * z),
    }[number]


def _left(values: Floats, fit: Floats) -> float:
    return float(np.sum((values - fit) ** 2) / np.sum((values - values.mean()) ** 2))


def _rank(name: str, foot: str, choice: str = "as assumed") -> float:
    """Rank of a foot by a metric, 1 for the lowest; NaN if grounds disagree."""
    ranks = 1 + np.argsort(np.argsort(_feet(name, choice), axis=0), axis=0)[list(FEET).index(foot)]
    return float(ranks[0]) if np.ptp(ranks) == 0 else float("nan")


def _slope_rank(name: str, foot: str, choice: str = "as assumed", errors: float = 0.0) -> float:
    """Rank of a foot by the slope of its values over stiffness, 1 for the steepest.

    `errors` moves its slope by so many standard errors of the line.
    """
    values, x = _feet(name, choice), np.asarray(STIFFNESSES) - np.mean(STIFFNESSES)
    slope = values @ x / (x @ x)
    residual = values - values.mean(axis=1, keepdims=True) - slope[:, None] * x
    own = list(FEET).index(foot)
    error = np.sqrt((residual[own] @ residual[own]) / (x.size - 2) / (x @ x))
    slope[own] += errors * error
    return float(1 + np.argsort(np.argsort(slope))[own])


def _less_sunk_of_six(choice: str = "as assumed") -> float:
    return 5 + int(np.argmin(_legs("sinkage_rms_m", choice)[4:]))


def _slip_to_five(choice: str = "as assumed") -> float:
    return _lower(_legs("slip_rms", choice)[:5]) - 1


def _drop() -> float:
    """Number of legs at which the largest sinkage first drops by 5 % or more."""
    largest = _legs("sinkage_largest_m")
    return 2 + int(np.argmax(1.0 - largest[1:] / largest[:-1] >= 0.05))


_COLUMNS = {"sinkage": "sinkage_mean_m", "slip": "slip_mean"}
#: Metric and foot of each rank, by key.
RANKS = {
    f"rank_{name}_{foot.lower()}": (column, foot)
    for name, column in _COLUMNS.items()
    for foot in ("none", "CIF")
}
SLOPE_RANKS = {
    f"rank_{name}_slope_{foot.lower()}": (_COLUMNS[name], foot)
    for name, feet in (("sinkage", ("LTF", "CIF")), ("slip", ("none", "LTF", "CIF")))
    for foot in feet
}


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    # of a flat plate pushed straight down, (rest + R z) upwards and against the travel
    "alpha_z_flat": lambda: float(resistance_terms(1.0, 0.0)[1] + resistance_terms(1.0, 0.0)[5]),
    "alpha_x_flat": lambda: -float(resistance_terms(1.0, 0.0)[0] + resistance_terms(1.0, 0.0)[3]),
    "rms_slip_legs": lambda: _lower(_legs("slip_rms")),
    "rms_slip_to_five": _slip_to_five,
    "rms_sinkage_legs": lambda: _lower(-_legs("sinkage_rms_m")),
    "max_sinkage_drop": _drop,
    "rms_sinkage_six": _less_sunk_of_six,
    "max_sinkage_six": lambda: 5 + int(np.argmin(_legs("sinkage_largest_m")[4:])),
    **{key: partial(_rank, *own) for key, own in RANKS.items()},
    **{key: partial(_slope_rank, *own) for key, own in SLOPE_RANKS.items()},
    **{
        key: partial(_sinkage_fit, key)
        for key in ("s_sigma", "s_sigma_r2", "s_i", "s_z", "s_phi_r2")
    },
}


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
