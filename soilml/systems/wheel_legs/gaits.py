"""Metrics of a turn of walking wheel-legs, and walks of many combinations as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from soilml.arrays import Array
from soilml.errors import InputError
from soilml.report.column_figure import column_picture
from soilml.report.report import Picture
from soilml.systems.wheel_legs.resistive_force import LinearGround, wheel_leg
from soilml.systems.wheel_legs.walk import Walk, WalkStatus, walk

TURN = 2.0 * np.pi
MOST = 400  # Walks at once
SWEPT = 3  # Values of a quantity from which on a picture has it along its axis
#: Columns that a picture may have along its axis, and those of each of its panels.
ALONG = ("stiffness_N_m3", "legs", "slip_commanded")
PANELS = (("slip_mean", "slip_rms"), ("sinkage_mean_m", "sinkage_largest_m"), ("torque_mean_Nm",))


def gait_metrics(walked: Walk) -> dict[str, Array]:
    """Metrics of the last full turn of every case by column, (cases,); NaN where one has stopped.

    Mean, root mean square and largest values of slip and sinkage (m), the mean of the motor torque
    (N m), and the sinkage at midstance. Raises `InputError` for a walk shorter than a turn.
    """
    if walked.angle[-1] < TURN - 1e-9:
        raise InputError(
            f"a walk of {walked.angle[-1] / TURN:.2g} turns; one full turn or more is needed"
        )
    last = walked.after(float(walked.angle[-1]) - TURN)
    sinkage, slip = last.sinkage, last.slip
    return {
        "slip_mean": slip.mean(axis=0),
        "slip_rms": np.sqrt(np.mean(slip**2, axis=0)),
        "sinkage_mean_m": sinkage.mean(axis=0),
        "sinkage_rms_m": np.sqrt(np.mean(sinkage**2, axis=0)),
        "sinkage_largest_m": sinkage.max(axis=0),
        "sinkage_midstance_m": last.at_midstance(sinkage),
        "torque_mean_Nm": last.torque.mean(axis=0),
    }


def walk_table(
    feet: Sequence[str],
    legs: Sequence[int],
    grounds: Mapping[str, LinearGround],
    slips: Sequence[float],
    turns: float = 2.0,
    **changes: Any,
) -> dict[str, Array]:
    """Walk with every combination of foot, legs, ground and commanded slip (NaN: free).

    `grounds` are by name; one that is named by its stiffness has no other name. `changes` are
    further fields of `WheelLeg`, such as its mass. Returns columns with a row for each walk: what
    was asked for, `gait_metrics`, and its status. Raises `InputError` for an unknown foot, an
    invalid wheel-leg, and too many walks.
    """
    cases = list(product(feet, legs, grounds, slips))
    if len(cases) > MOST:
        raise InputError(f"{len(cases)} walks; at most {MOST} are possible at once")
    foot, count, under, slip = (np.asarray(part) for part in zip(*cases, strict=True))
    stiffness = np.asarray([grounds[name].stiffness for name in under])
    walked = walk(
        [wheel_leg(foot, legs=count, **changes) for foot, count, _, _ in cases],
        [grounds[name] for name in under],
        slip=slip.astype(float),
        turns=turns,
    )
    named = under != np.asarray([f"{value:g}" for value in stiffness])
    return {
        "foot": foot,
        "legs": count,
        "ground": np.where(named, under, ""),
        "stiffness_N_m3": stiffness,
        "slip_commanded": slip.astype(float),
        **gait_metrics(walked),
        "status": np.asarray([WalkStatus(int(code)).reason for code in walked.status]),
    }


def walk_picture(columns: Mapping[str, Array]) -> Picture:
    """Metrics of walks against the first of stiffness, legs and slip that has three values or more.

    Raises `InputError` where none has.
    """
    soil = "ground" if np.any(columns["ground"] != "") else "stiffness_N_m3"
    sizes = {
        name: np.unique(columns[name]).size for name in ("foot", "legs", soil, "slip_commanded")
    }
    swept = [name for name in ALONG if sizes.get(name, 0) >= SWEPT]
    if not swept:
        raise InputError(
            f"{len(columns['foot'])} walks; a picture needs three or more values of legs, "
            "stiffness or slip"
        )
    lines = tuple(name for name, size in sizes.items() if size > 1 and name != swept[0])
    return column_picture(columns, swept[0], PANELS, lines)
