"""Slip of a rover without odometry, on simulated drives: `python bench/run.py slip-unknown`.

Fixed numbers of the filter were chosen on drives of the seeds `TUNED`, the tables are of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from benchmarks_file import ROOT
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
WORLDS: dict[str, dict[str, Any]] = {
    "equal rim speeds": {},
    "rim speeds 10 % apart": {"apart": 0.1},
    "the same with slip-sinkage 0.3": {"apart": 0.1, "mechanism": "slip-sinkage", "size": 0.3},
}
ABOUT = (
    f"Drives of docs/how-to/slip-unknown.md, {len(TESTED)} a line, by the reference wheel of "
    "`datagen/blind_sets`: three soils of 60 rows each, on slopes of -11 to 20 degrees. "
    "Friction and gain of each drive and the zero of the pitch are drawn for each drive. Each "
    "cell: rmse of the slip of a wheel, coverage of its 90 % interval, its median width. "
    "*Filter*: `soilml slip`, which knows the prior alone. *Known soil*: the same filter with "
    "the true soil and its begin; with slip-sinkage it knows the soil, and not the mechanism. "
    "*Line*: slip as a straight line of torque over radius and load, fitted to drives whose "
    "slip is known. *Refused*: rows that were called a hard floor. Numbers of the filter were "
    "chosen on other seeds."
)


@dataclass(frozen=True)
class Answers:
    """Slips (rows, wheels) beside the truth."""

    true: Floats
    low: Floats
    middle: Floats
    high: Floats
    no_soil: Floats  # (rows,)

    def cells(self, rows: np.ndarray | slice = slice(None)) -> str:
        """Rmse, coverage of the 90 % interval, and its median width."""
        true, low, high = self.true[rows], self.low[rows], self.high[rows]
        rms = np.sqrt(np.mean((self.middle[rows] - true) ** 2))
        held = np.mean((low <= true) & (true <= high))
        return f"{rms:.3f} | {100 * held:.0f} % | {np.median(high - low):.2f}"


def case() -> Any:
    """The rover of the example."""
    return read_case(ROOT / "examples/slip/rover.toml")


def filtered(drive: Drive, table: ForceTable) -> Answers:
    """What the filter says of a drive."""
    rover = case()
    filter_ = SlipFilter(table, rover.rover.weight, rover.drive)
    belief, found = filter_.start(), []
    for i in range(len(drive.time)):
        load, slope = loads(drive.slope[i]), float(drive.slope[i])
        answer, belief = filter_.step(belief, drive.rim_speed[i], drive.torque[i], load, slope)
        found.append((*answer.slip, np.full(4, answer.no_soil)))
    low, middle, high, floor = np.moveaxis(np.asarray(found), 1, 0)
    return Answers(drive.slip, low, middle, high, floor[:, 0])


def knowing(drive: Drive) -> Answers:
    """The same where each soil and its begin are known."""
    parts = []
    for number, soil in enumerate(drive.soils):
        own = drive.ground == number
        names = tuple(case().prior)
        values = np.tile([soil[name] for name in names], (KNOWN, 1))
        table = force_table(case(), LOADS, soils=SoilDraws(names, values))
        rows = {n: getattr(drive, n)[own] for n in ("time", "rim_speed", "torque", "slope", "slip")}
        parts.append(filtered(Drive(**rows, speed=drive.speed[own], ground=drive.ground[own],
                                    soils=drive.soils), table))  # fmt: skip
    return joined(parts)


def joined(parts: Sequence[Answers]) -> Answers:
    """Several answers as one."""
    return Answers(*(np.concatenate([getattr(p, n) for p in parts]) for n in vars(parts[0])))


def pull_share(drive: Drive) -> Floats:
    """Torque over radius and load of each wheel, (rows, wheels)."""
    return drive.torque / (RADIUS * loads(drive.slope))


def linear_law(drives: Sequence[Drive]) -> tuple[Floats, float]:
    """Slip as a straight line of torque over radius and load, and the standard error."""
    x, y = (np.concatenate([f(d).ravel() for d in drives]) for f in (pull_share, lambda d: d.slip))
    line = np.polyfit(x, y, 1)
    return line, float(np.std(y - np.polyval(line, x)))


def by_line(drive: Drive, line: Floats, std: float) -> Answers:
    """Slip by that law."""
    middle = np.polyval(line, pull_share(drive))
    reach = Z_90 * std
    return Answers(drive.slip, middle - reach, middle, middle + reach, np.zeros(len(drive.time)))


def _one(seed: int, world: dict[str, Any], table: ForceTable, line: Any) -> list[Answers]:
    drive = simulate_drive(seed, **world)
    return [filtered(drive, table), knowing(drive), by_line(drive, *line)]


def scores(
    seeds: Sequence[int], worlds: Sequence[str], workers: int = 2
) -> dict[str, list[Answers]]:
    """Answers of the three methods in each world, all drives joined."""
    table = force_table(case(), LOADS)
    with ProcessPoolExecutor(workers) as pool:
        line = linear_law(list(pool.map(simulate_drive, TUNED)))
        found = {}
        for name in worlds:
            one = partial(_one, world=WORLDS[name], table=table, line=line)
            each = list(pool.map(one, seeds))
            found[name] = [joined([e[i] for e in each]) for i in range(3)]
    return found


def floors(seeds: Sequence[int], workers: int = 2) -> Floats:
    """Probability of a hard floor at each row of drives on one, (drives, rows)."""
    table = force_table(case(), LOADS)
    with ProcessPoolExecutor(workers) as pool:
        drives = pool.map(partial(simulate_drive, floor=True), seeds)
        found = pool.map(partial(filtered, table=table), drives)
        return np.asarray([one.no_soil for one in found])


def table(seeds: Sequence[int] = TESTED, worlds: Sequence[str] = tuple(WORLDS)) -> str:
    """The tables of its page."""
    three = " | ".join(f"{n}: rmse | covered | width" for n in ("filter", "known soil", "line"))
    lines = [f"| drives | rows | {three} | refused |", "|---" + "|---:" * 11 + "|"]
    for name, found in scores(seeds, worlds).items():
        cells = " | ".join(one.cells() for one in found)
        refused = np.mean(found[0].no_soil > NO_SOIL)
        lines.append(f"| {name} | {len(found[0].true)} | {cells} | {100 * refused:.1f} % |")
        for low, high in ((-1.0, 0.1), (0.1, 0.3), (0.3, 1.0)):
            rows = (found[0].true[:, 0] >= low) & (found[0].true[:, 0] < high)
            cells = " | ".join(one.cells(rows) for one in found)
            lines.append(f"| - slip {low:g} to {high:g} | {rows.sum()} | {cells} | |")
    floor = floors(seeds)
    after = floor[:, SETTLED:] > NO_SOIL
    lines += [
        "",
        f"Hard floor: {len(floor)} drives; refused {100 * np.mean(after):.0f} % of the rows from "
        f"the {SETTLED}th on.",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
