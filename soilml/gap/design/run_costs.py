"""Costs of runs and checks, by kind, and the ranking by what they tell per cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from soilml.errors import InputError
from soilml.gap.design.gear_changes import SIZES, SMOOTH_GEAR
from soilml.gap.design.static_checks import SENSOR_CHECKS, SOIL_TESTS
from soilml.gap.report_parts import NextRun

#: Kinds of runs on the present gear.
DRIVEN = (
    *("heavier", "lighter", "higher slip", "low slip", "braking"),
    *("reverse", "other speed", "second pass", "slip angle"),
)
#: All kinds of runs and checks that can be proposed.
KINDS = (*DRIVEN, SMOOTH_GEAR, *SIZES, *SOIL_TESTS, *SENSOR_CHECKS)
#: Proposals that are listed.
LISTED = 8


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
