"""Kinds of runs and checks: what checks and tests of the soil determine, and what each costs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.errors import InputError
from soilml.gap.design.run_options import SIZES, SMOOTH_GEAR
from soilml.gap.report.results import NextRun

#: Checks of sensors and rig: kind -> (instruction, effect -> standard deviation of its size after
#: the check, in the unit of the size).
SENSOR_CHECKS: dict[str, tuple[str, dict[str, float]]] = {
    "dead-weight torque": (
        "hang a known weight on a lever at the hub and read the torque sensor",
        {"torque-gain": 0.003, "torque-offset": 0.01},
    ),
    "weighed wheel": (
        "place the wheel on a scale and read the load sensor",
        {"load-gain": 0.003, "load-transfer": 0.005},
    ),
    "lifted wheel": (
        "lift the wheel off the soil, turn it, and read all sensors",
        {"torque-offset": 0.01, "bearing-friction": 0.001, "drawbar-offset": 0.05},
    ),
    "pulled spring scale": (
        "pull the axle with a known force and read the drawbar sensor",
        {"drawbar-gain": 0.003, "drawbar-offset": 0.05},
    ),
    "gauge blocks": (
        "set the wheel on blocks of known height and read the sinkage sensor",
        {"sinkage-offset": 0.0001, "sinkage-gain": 0.003},
    ),
    "levelled bed": ("put an inclinometer on the bed", {"slope": 0.001}),
    "marked wheel": (
        "roll the wheel ten turns without slip and measure the distance",
        {"slip-scale": 0.002},
    ),
    "towed wheel": (
        "tow the wheel, whose rolling radius is known, unpowered on hard ground and read its slip",
        {"slip-offset": 0.002},
    ),
}

#: Tests of the soil with a bevameter: kind -> (instruction, soil parameter -> standard deviation
#: after the test, whether that is relative). Twice the usual variation of prepared soil from place
#: to place (0.5 deg of friction angle, 5 % of the bearing moduli), as a plate and a ring load the
#: soil otherwise than a wheel does; cohesion and shear modulus are read less well off the curves.
SOIL_TESTS: dict[str, tuple[str, dict[str, tuple[float, bool]]]] = {
    "plate test": (
        "press plates of two widths into the soil and fit pressure against sinkage",
        {"kc": (0.1, True), "kphi": (0.1, True), "n": (0.05, False)},
    ),
    "shear test": (
        "turn a shear ring on the soil under three normal stresses and fit stress against "
        "displacement",
        {
            "cohesion": (200.0, False),
            "friction_angle": (float(np.deg2rad(1.0)), False),
            "shear_modulus": (0.2, True),
        },
    ),
}


#: Kinds of runs on the present gear.
DRIVEN = (
    *("heavier", "lighter", "higher slip", "low slip", "braking"),
    *("reverse", "other speed", "second pass", "slip angle"),
)
#: All kinds of runs and checks that can be proposed.
KINDS = (*DRIVEN, SMOOTH_GEAR, *SIZES, *SOIL_TESTS, *SENSOR_CHECKS)
LISTED = 8  # Proposals that are listed


def check_costs(costs: Mapping[str, float]) -> dict[str, float]:
    """Costs by the names of `KINDS`; raises `InputError` for another kind or no positive number.

    In a name given here, hyphens and spaces are the same: ``second-pass``.
    """
    names = {kind.replace("-", " "): kind for kind in KINDS}
    checked = {}
    for given, cost in costs.items():
        kind = names.get(given.replace("-", " "))
        if kind is None:
            known = ", ".join(name.replace(" ", "-") for name in names)
            raise InputError(f"cost of {given!r}: no such kind of run; there are: {known}")
        if not (math.isfinite(cost) and cost > 0.0):
            raise InputError(f"cost of {given!r} is {cost:g}; needed is a number above zero")
        checked[kind] = float(cost)
    return checked


def rank_by_cost(runs: Sequence[NextRun], costs: Mapping[str, float]) -> list[NextRun]:
    """The most useful runs: by discrimination, or by discrimination per cost where costs are given.

    A kind without cost costs 1.
    """
    if costs:
        runs = [replace(run, cost=costs.get(run.kind, 1.0)) for run in runs]
    return sorted(runs, key=lambda run: -run.discrimination / (run.cost or 1.0))[:LISTED]
