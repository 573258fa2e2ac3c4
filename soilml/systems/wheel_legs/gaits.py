"""Metrics of a turn of walking wheel-legs, and walks of many combinations as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
MOST_DRAWN = 8  # Walks of one picture over a turn
SWEPT = 3  # Values of a quantity from which on a picture has it along its axis


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


@dataclass(frozen=True)
class WalkTables:
    """Walks as columns by name, in SI units.

    columns: A row for each walk: its keys, the metrics of its last full turn, and its status.
    motion: A row for each instant of that turn of each walk that goes on.
    keys: Columns of both that tell the walks apart, of those that vary.
    """

    columns: Mapping[str, Any]
    motion: Mapping[str, Any]
    keys: tuple[str, ...]

    @property
    def picture(self) -> Picture:
        """Metrics against the first quantity of three values or more; else the turns themselves.

        Raises `InputError` for more turns than a picture shows.
        """
        swept = [
            name
            for name in self.keys
            if name in ("stiffness_N_m3", "legs", "slip_commanded")
            and np.unique(self.columns[name]).size >= SWEPT
        ]
        if swept:
            shown = [("slip_mean", "slip_rms"), ("sinkage_mean_m", "sinkage_largest_m")]
            others = tuple(name for name in self.keys if name != swept[0])
            return column_picture(self.columns, swept[0], [*shown, ("torque_mean_Nm",)], others)
        if len(self.columns["foot"]) > MOST_DRAWN:
            raise InputError(
                f"{len(self.columns['foot'])} walks; a picture shows the turns of {MOST_DRAWN} or "
                "fewer: ask for fewer, or for three or more values of legs, stiffness or slip"
            )
        panels = [("slip",), ("sinkage_m",), ("torque_Nm",), ("hub_height_m",)]
        return column_picture(self.motion, "turned_rad", panels, self.keys)


def walk_tables(
    feet: Sequence[str],
    legs: Sequence[int],
    grounds: Mapping[str, LinearGround],
    slips: Sequence[float],
    turns: float = 2.0,
    **changes: Any,
) -> WalkTables:
    """Walk with every combination of foot, legs, ground and commanded slip (NaN: free).

    `grounds` are by name; one that is named by its stiffness has no other name. `changes` are
    further fields of `WheelLeg`, such as its mass. Raises `InputError` for an unknown foot, an
    invalid wheel-leg, and too many walks.
    """
    cases = list(product(feet, legs, grounds, slips))
    if len(cases) > MOST:
        raise InputError(f"{len(cases)} walks; at most {MOST} are possible at once")
    foot, count, under, slip = (np.asarray(part) for part in zip(*cases, strict=True))
    walked = walk(
        [wheel_leg(foot, legs=count, **changes) for foot, count, _, _ in cases],
        [grounds[name] for name in under],
        slip=slip.astype(float),
        turns=turns,
    )
    metrics = gait_metrics(walked)
    numbers = {name for name, ground in grounds.items() if name == f"{ground.stiffness:g}"}
    asked: dict[str, Any] = {
        "foot": foot,
        "legs": count,
        "ground": np.asarray(["" if name in numbers else name for name in under]),
        "stiffness_N_m3": np.asarray([grounds[name].stiffness for name in under]),
        "slip_commanded": slip.astype(float),
    }
    last = walked.after(float(walked.angle[-1]) - TURN)
    goes_on = np.flatnonzero(walked.status == WalkStatus.OK)
    instants = last.angle.size
    motion = {name: np.repeat(values[goes_on], instants) for name, values in asked.items()}
    motion["turned_rad"] = np.tile(last.angle - last.angle[0], goes_on.size)
    over_time = {
        "time_s": last.time - last.time[:1],
        "slip": last.slip,
        "sinkage_m": last.sinkage,
        "torque_Nm": last.torque,
        "hub_height_m": last.z,
        "hub_x_m": last.x - last.x[:1],
    }
    motion |= {name: values[:, goes_on].T.ravel() for name, values in over_time.items()}
    soil = "stiffness_N_m3" if numbers else "ground"
    keys = tuple(
        name for name in ("foot", "legs", soil, "slip_commanded") if np.unique(asked[name]).size > 1
    )
    status = np.asarray([WalkStatus(int(code)).reason for code in walked.status])
    return WalkTables({**asked, **metrics, "status": status}, motion, keys)
