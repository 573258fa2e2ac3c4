"""The numbers that Comin and Saaj 2017 print on walking by resistive-force theory, computed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from soilml.arrays import Array
from soilml.systems.wheel_legs.gait_metrics import (
    FeetComparison,
    GaitMetrics,
    compare_feet,
    compare_legs,
    decreasing_until,
)
from soilml.systems.wheel_legs.resistive_force import LinearGround, stress_gains
from soilml.systems.wheel_legs.sinkage_fit import (
    SimulatedSinkage,
    SinkageFit,
    fit_simulated_sinkage,
    simulate_sinkage,
)

#: Ground for the comparison of numbers of legs: the middle of the paper's range; not printed.
MIDDLE = LinearGround(stiffness=0.7e6)


@cache
def _legs() -> GaitMetrics:
    return compare_legs(MIDDLE)


@cache
def _feet() -> FeetComparison:
    return compare_feet()


@cache
def _soils() -> SimulatedSinkage:
    return simulate_sinkage()


@cache
def _fit() -> SinkageFit:
    return fit_simulated_sinkage(_soils())


def _rank(values: Array, foot: str) -> float:
    """Rank of a foot, from 1 for the lowest value; NaN if grounds disagree."""
    rows = values.reshape(len(_feet().feet), -1)
    ranks = 1 + np.argsort(np.argsort(rows, axis=0), axis=0)[_feet().feet.index(foot)]
    return float(ranks[0]) if np.ptp(ranks) == 0 else float("nan")


def _slope(values: Array) -> Array:
    return _feet().sensitivity(values)[0]


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    "alpha_z_flat": lambda: float(stress_gains(0.0, 0.5 * np.pi)[1]),
    "alpha_x_flat": lambda: float(stress_gains(0.0, 0.5 * np.pi)[0]),
    "rms_slip_legs": lambda: decreasing_until(_legs().rms_slip),
    "rms_slip_to_five": lambda: decreasing_until(_legs().rms_slip[:5]) - 1,
    "rms_sinkage_legs": lambda: decreasing_until(-_legs().rms_sinkage),
    "max_sinkage_drop": lambda: 2 + int(np.argmax(_drop() >= 0.05)),
    "rms_sinkage_six": lambda: 5 + int(np.argmin(_legs().rms_sinkage[4:])),
    "max_sinkage_six": lambda: 5 + int(np.argmin(_legs().max_sinkage[4:])),
    "rank_sinkage_none": lambda: _rank(_feet().sinkage, "none"),
    "rank_sinkage_cif": lambda: _rank(_feet().sinkage, "CIF"),
    "rank_slip_none": lambda: _rank(_feet().slip, "none"),
    "rank_slip_cif": lambda: _rank(_feet().slip, "CIF"),
    "rank_sinkage_slope_ltf": lambda: _rank(_slope(_feet().sinkage), "LTF"),
    "rank_sinkage_slope_cif": lambda: _rank(_slope(_feet().sinkage), "CIF"),
    "rank_slip_slope_none": lambda: _rank(_slope(_feet().slip), "none"),
    "rank_slip_slope_ltf": lambda: _rank(_slope(_feet().slip), "LTF"),
    "rank_slip_slope_cif": lambda: _rank(_slope(_feet().slip), "CIF"),
    "s_sigma": lambda: _fit().s_sigma / 100.0,
    "s_sigma_r2": lambda: _fit().stiffness_r2,
    "s_i": lambda: _fit().s_i,
    "s_z": lambda: _fit().s_z / 100.0,
    "s_phi_r2": lambda: _fit().friction_r2,
}


def _drop() -> Array:
    """Relative decrease of the maximum sinkage by each additional leg."""
    largest = _legs().max_sinkage
    return 1.0 - largest[1:] / largest[:-1]
