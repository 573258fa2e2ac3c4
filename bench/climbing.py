"""How often bands of climbing ability hold the truth, on rovers that nothing was settled with.

The table of docs/papers/nagatani_climbing.md: `make bench-papers`, about five minutes.
"""

from __future__ import annotations

import math

import numpy as np

from soilml.climbing.coverage import coverage
from soilml.writing import aligned

SEEDS = range(1000, 1060)
LINES = (
    ("0, 4", ("cohesion", "friction_angle"), True),
    ("0, 4, 8", ("cohesion", "friction_angle"), False),
    ("0, 4, 8, 10", ("cohesion",), True),
    ("0, 4, 8, 10", (), False),
)
HEADER = ("slopes, deg", "sought", "loads", "phi", "k_x", "pull at 0.4", "steepest", "its rms, deg")


def run() -> None:
    """One line for each number of slopes driven: share in the 90 % band, error over std."""
    table = []
    for slopes, given, known in LINES:
        angles = np.deg2rad([float(s) for s in slopes.split(",")])
        found = coverage(SEEDS, angles.tolist(), given=given, knows_loads=known)
        names = ("friction_angle", "shear_modulus", "pull", "steepest")
        cells = [
            f"{100 * found[n].inside:.0f} %, {found[n].score:.2f}" if n in found else ""
            for n in names
        ]
        sought = {"cohesion": "c", "friction_angle": "phi", "shear_modulus": "k_x"}
        rms = math.degrees(float(np.sqrt(np.mean(found["steepest"].error ** 2))))
        what = ", ".join(short for name, short in sought.items() if name not in given)
        table.append((slopes, what, "known" if known else "found", *cells, f"{rms:.2f}"))
        print(aligned(HEADER, table[-1:], text_columns=3), flush=True)
    print("\n" + aligned(HEADER, table, text_columns=3))


if __name__ == "__main__":
    run()
