"""Slips that `soilml drive slip` infers from drive.csv, beside the true ones; `--make` draws them.

Rows 0 to 39: one soil, all rims at one speed. Rows 40 to 79: the same soil, rim speeds 10 % apart.
Rows 80 to 99: a hard floor.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from soilml import read_case, read_table
from soilml.io.text_tables import csv_text
from soilml.report.aligned_text import format_table
from soilml.slip_filter.drive import slip_of_drive

HERE = Path(__file__).parent
PARTS = {"equal rim speeds": 40, "rim speeds 10 % apart": 40, "hard floor": 20}
SEED = 3  # Of the drive


def make() -> None:
    """Write drive.csv and truth.csv."""
    sys.path.insert(0, str(HERE.parents[1] / "bench"))
    from slip_drives import WHEELS, simulate_drive

    equal, apart, hard = PARTS.values()
    drives = [
        simulate_drive(SEED, soils=1, rows=equal),
        simulate_drive(SEED, soils=1, rows=apart, apart=0.1),
        simulate_drive(SEED, rows=hard, floor=True),
    ]
    parts = [drive.columns() for drive in drives]
    columns = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    columns["time_s"] = np.repeat(np.arange(sum(PARTS.values()), dtype=float), len(WHEELS))
    slip = np.concatenate([drive.slip.ravel() for drive in drives])
    rounded = {n: v if n == "wheel" else np.round(v, 5) for n, v in columns.items()}
    (HERE / "drive.csv").write_text(csv_text(rounded))
    truth = {"time_s": columns["time_s"], "wheel": columns["wheel"], "slip": np.round(slip, 5)}
    (HERE / "truth.csv").write_text(csv_text(truth))


def compare() -> None:
    """Print a line for each part."""
    found = slip_of_drive(read_case(HERE / "rover.toml"), read_table(HERE / "drive.csv"))
    true = read_table(HERE / "truth.csv", ("slip",))["slip"].reshape(found.slip[:, 1].shape)
    lines, start = [], 0
    for name, count in PARTS.items():
        rows = np.arange(start, start + count)
        start += count
        refused = f"{np.sum(['no-soil' in found.flags[i] for i in rows])} of {count}"
        rows = rows[found.answered[rows]]
        cells = ["", "", ""]
        if 2 * len(rows) > count:
            low, middle, high = np.moveaxis(found.slip[rows], 1, 0)
            held = np.mean((low <= true[rows]) & (true[rows] <= high))
            error = np.sqrt(np.mean((middle - true[rows]) ** 2))
            cells = [f"{error:.3f}", f"{np.median(high - low):.2f}", f"{100 * held:.0f} %"]
        ends = f"{true[start - count : start].min():.2f} to {true[start - count : start].max():.2f}"
        lines.append((name, ends, *cells, refused))
    header = ("part", "true slip", "rmse", "width", "covered", "refused")
    print(format_table(header, lines, text_columns=1))


if __name__ == "__main__":
    make() if "--make" in sys.argv else compare()
