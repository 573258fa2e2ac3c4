"""Slip of a rover without odometry, on simulated drives.

Fixed numbers of the filter were chosen on drives of other seeds.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, percent, rms, table
from slip_drives import Drive, loads, simulate_drive

from soilml import read_case
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import ForceTable, force_table

Floats = np.ndarray[Any, np.dtype[np.float64]]

TESTED = range(500, 508)
LOADS = (20.0, 140.0)  # N, of the table
NO_SOIL = 0.5  # Probability of a hard floor from which on a row is refused
SETTLED = 10  # Rows after a change from which a soil counts as found
#: Lines: name, and what differs.
FLOOR = "hard floor"
WORLDS: dict[str, dict[str, Any]] = {
    "equal rim speeds": {},
    "rim speeds 10 % apart": {"apart": 0.1},
    "the same with slip-sinkage 0.3": {"apart": 0.1, "mechanism": "slip-sinkage", "size": 0.3},
    FLOOR: {"floor": True},
}
#: Ends of bands of the slip of the first wheel.
BANDS = (0.1, 0.3)
ABOUT = (
    f"Drives of docs/how-to/drive.md, {len(TESTED)} a line, by the reference wheel of "
    "`datagen/blind_sets`: three soils of 60 rows each, on slopes of -11 to 20 degrees. "
    "Friction and gain of each drive and the zero of the pitch are drawn for each drive. Each "
    "line: rmse of the slip of a wheel, coverage of its 90 % interval, its median width. The "
    "filter knows the prior of the soil alone. *Refused*: rows that were called a hard floor."
)


def cases(sample: Sample) -> list[Row]:
    """Each drive of each world."""
    return [{"world": w, "seed": seed} for w in WORLDS for seed in sample.of(TESTED)]


@cache
def rover() -> Any:
    """The case of the example."""
    return read_case(ROOT / "examples/slip/rover.toml")


@cache
def prior_table() -> ForceTable:
    """Pull and torque over soils of the prior."""
    return force_table(rover(), LOADS)


def one_drive(case: Row) -> list[Row]:
    """Rows of a drive: errors and intervals of the slip of each wheel by each method."""
    drive = simulate_drive(case["seed"], **WORLDS[case["world"]])
    found, floor = filtered(drive, prior_table())
    return [
        {
            "row": i,
            "true": true[0],
            "floor": floor[i] > NO_SOIL,
            "error": middle - true,
            "held": (low <= true) & (true <= high),
            "width": high - low,
        }
        for i, (true, (low, middle, high)) in enumerate(zip(drive.slip, found, strict=True))
    ]


def filtered(drive: Drive, table: ForceTable) -> tuple[Floats, Floats]:
    """Interval and middle of each slip (rows, 3, wheels), and probability of a floor (rows,)."""
    slips = SlipFilter(table, rover().rover.weight, rover().drive)
    belief, found, floor = slips.start(), [], []
    for i in range(len(drive.time)):
        load, slope = loads(drive.slope[i]), float(drive.slope[i])
        answer, belief = slips.step(belief, drive.rim_speed[i], drive.torque[i], load, slope)
        found.append(answer.slip)
        floor.append(answer.no_soil)
    return np.asarray(found), np.asarray(floor)


def tables(rows: list[Row]) -> str:
    """A line for each world, and for bands of slip in it; rows that are refused."""
    columns = {
        "rows": len,
        "filter: rmse": lambda own: f"{rms([r['error'] for r in own]):.3f}",
        "filter: covered": lambda own: f"{100 * np.mean([r['held'] for r in own]):.0f} %",
        "filter: width": lambda own: f"{np.median([r['width'] for r in own]):.2f}",
        "refused": percent("floor", 1),
    }
    driven = [r for r in rows if r["world"] != FLOOR]
    ends = [-1.0, *BANDS, 1.0]
    for row in driven:
        band = np.searchsorted(BANDS, row["true"], side="right")
        row["band"] = f"{ends[band]:g} to {ends[band + 1]:g}"
    driven.sort(key=lambda row: (list(WORLDS).index(row["world"]), row["band"]))
    floor = [r for r in rows if r["world"] == FLOOR]
    after = [r["floor"] for r in floor if r["row"] >= SETTLED]
    drives = len({r["seed"] for r in floor})
    return (
        f"{table(driven, {'drives': 'world'}, columns)}\n\n"
        f"{table(driven, {'drives': 'world', 'slip': 'band'}, columns)}\n\nHard floor: {drives} "
        f"drives; refused {100 * np.mean(after):.0f} % of the rows from the {SETTLED}th on."
    )


SLIP_UNKNOWN = Bench("slip-unknown", "Slip without odometry", ABOUT, cases, one_drive, tables)
