"""Slip of a rover without odometry, on simulated drives.

Fixed numbers of the filter were chosen on drives of the seeds `TUNED`, the tables are of others.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, markdown, rms
from slip_drives import RADIUS, Drive, loads, simulate_drive

from soilml import read_case
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import ForceTable, force_table
from soilml.traction.draws import SoilDraws

Floats = np.ndarray[Any, np.dtype[np.float64]]

TUNED, TESTED = range(100, 107), range(500, 508)
KNOWN = 256  # Grounds of the filter that knows the soil: one soil, and as many errors of the pull
Z_90 = 1.645
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
METHODS = ("filter", "known soil", "line")
#: Bands of the slip of the first wheel.
BANDS = ((-1.0, 0.1), (0.1, 0.3), (0.3, 1.0))
ABOUT = (
    f"Drives of docs/how-to/drive.md, {len(TESTED)} a line, by the reference wheel of "
    "`datagen/blind_sets`: three soils of 60 rows each, on slopes of -11 to 20 degrees. "
    "Friction and gain of each drive and the zero of the pitch are drawn for each drive. Each "
    "cell: rmse of the slip of a wheel, coverage of its 90 % interval, its median width. *Filter*: "
    "`soilml drive slip`, which knows the prior alone. *Known soil*: the same filter with "
    "the true soil and its begin; with slip-sinkage it knows the soil, and not the mechanism. "
    "*Line*: slip as a straight line of torque over radius and load, fitted to drives whose "
    "slip is known. *Refused*: rows that were called a hard floor. Numbers of the filter were "
    "chosen on other seeds."
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
    own, floor = filtered(drive, prior_table())
    answers = [own] if case["world"] == FLOOR else [own, known(drive), by_line(drive)]
    return [
        {
            "row": i,
            "true": true[0],
            "floor": floor[i],
            "error": [each[i, 1] - true for each in answers],
            "held": [(each[i, 0] <= true) & (true <= each[i, 2]) for each in answers],
            "width": [each[i, 2] - each[i, 0] for each in answers],
        }
        for i, true in enumerate(drive.slip)
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


def known(drive: Drive) -> Floats:
    """The same where each soil and its begin are known."""
    parts = []
    for number, soil in enumerate(drive.soils):
        of_rows = [f.name for f in fields(Drive) if f.name != "soils"]
        own = {name: getattr(drive, name)[drive.ground == number] for name in of_rows}
        names = tuple(rover().prior)
        values = np.tile([soil[name] for name in names], (KNOWN, 1))
        table = force_table(rover(), LOADS, soils=SoilDraws(names, values))
        parts.append(filtered(replace(drive, **own), table)[0])
    return np.concatenate(parts)


def pull_share(drive: Drive) -> Floats:
    """Torque over radius and load of each wheel, (rows, wheels)."""
    return drive.torque / (RADIUS * loads(drive.slope))


@cache
def linear_law() -> tuple[Floats, float]:
    """Slip as a straight line of torque over radius and load, and the standard error."""
    drives = [simulate_drive(seed) for seed in TUNED]
    x, y = (np.concatenate([f(d).ravel() for d in drives]) for f in (pull_share, lambda d: d.slip))
    line = np.polyfit(x, y, 1)
    return line, float(np.std(y - np.polyval(line, x)))


def by_line(drive: Drive) -> Floats:
    """Slip by that law."""
    line, std = linear_law()
    middle = np.polyval(line, pull_share(drive))
    return np.stack([middle - Z_90 * std, middle, middle + Z_90 * std], axis=1)


def cells(rows: list[Row]) -> list[str]:
    """Rmse, coverage of the 90 % interval and its median width, by each method."""
    error, held, width = (np.asarray([r[k] for r in rows]) for k in ("error", "held", "width"))
    found = []
    for k in range(len(METHODS)):
        found += [f"{rms(error[:, k]):.3f}", f"{100 * held[:, k].mean():.0f} %"]
        found.append(f"{np.median(width[:, k]):.2f}")
    return found


def tables(rows: list[Row]) -> str:
    """A line for each world, and for bands of slip in it; rows that are refused."""
    lines = []
    for name in WORLDS:
        own = [r for r in rows if r["world"] == name]
        if name == FLOOR or not own:
            continue
        refused = np.mean([r["floor"] > NO_SOIL for r in own])
        lines.append((name, len(own), *cells(own), f"{100 * refused:.1f} %"))
        for low, high in BANDS:
            some = [r for r in own if low <= r["true"] < high]
            lines.append((f"- slip {low:g} to {high:g}", len(some), *cells(some), ""))
    head = [f"{n}: {what}" for n in METHODS for what in ("rmse", "covered", "width")]
    floor = [r for r in rows if r["world"] == FLOOR]
    after = [r["floor"] > NO_SOIL for r in floor if r["row"] >= SETTLED]
    drives = len({r["seed"] for r in floor})
    return (
        f"{markdown(('drives', 'rows', *head, 'refused'), lines)}\n\nHard floor: {drives} drives; "
        f"refused {100 * np.mean(after):.0f} % of the rows from the {SETTLED}th on."
    )


SLIP_UNKNOWN = Bench("slip-unknown", "Slip without odometry", ABOUT, cases, one_drive, tables)
