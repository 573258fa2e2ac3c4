"""Largest pull of four measured wheels beside the band of `soilml plan wheels` before any row.

    python examples/design/measured.py DATA     # the folder with ding2011 and kls1_rashid1

Each wheel stands for a rover of four on level ground, up to the largest measured slip.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from soilml import soil_catalogue
from soilml.rover_design.performance import evaluate
from soilml.rover_design.study import ClimbingGoal, DesignStudy, SoilQuestion
from soilml.rover_design.worlds import draw_worlds

EARTH = 9.80665
#: File, columns of load and pull, beginning of the rows' names, published soil.
WHEELS = {
    "HIT-LSS1, smooth": ("ding2011", "case_id", "ding2011_smooth", "ding2015/hit_lss1"),
    "HIT-LSS1, lugs of 10 mm": ("ding2011", "case_id", "ding2011_lug10", "ding2015/hit_lss1"),
    "KLS-1, smooth": ("kls1_rashid1", "run", "kls1_smooth", "wang2016/kls1"),
    "KLS-1, lugs of 10 mm": ("kls1_rashid1", "run", "kls1_lug10", "wang2016/kls1"),
}


def largest_pulls(data: Path) -> Iterator[tuple[str, float, float, float, float]]:
    """Name, measured largest pull, median and 90 % band of each wheel, N."""
    for name, (folder, key, begin, soil) in WHEELS.items():
        with (data / folder / "single_wheel_tests.csv").open() as opened:
            rows = [row for row in csv.DictReader(opened) if row[key].startswith(begin)]
        load = float(rows[0].get("load_N") or rows[0]["vertical_load_n"])
        pulls = [float(row.get("drawbar_pull_N") or row["meas_drawbar_pull_n"]) for row in rows]
        design = {
            "radius": float(rows[0]["wheel_radius_m"]),
            "width": float(rows[0]["wheel_width_m"]),
            "lug_height": float(rows[0]["grouser_height_m"]),
            "wheels": 4.0,
            "mass": 4.0 * load / EARTH,
        }
        goal = ClimbingGoal(0.0, slip_limit=max(float(row["slip"]) for row in rows))
        question = SoilQuestion({soil: soil_catalogue()[soil]})
        study = DesignStudy({}, 1.0, (0.0, 0.0), EARTH, question, goal)
        worlds = draw_worlds(question, 1000, goal.slip_limit)
        found = evaluate(study, {k: np.asarray([v]) for k, v in design.items()}, worlds)
        low, middle, high = np.quantile(found.margin[0] / 4.0, [0.05, 0.5, 0.95])
        yield name, max(pulls), float(middle), float(low), float(high)


if __name__ == "__main__":
    print("| wheel | measured, N | median, N | 90 %, N |\n|---|---:|---:|---:|")
    for name, pull, middle, low, high in largest_pulls(Path(sys.argv[1])):
        print(f"| {name} | {pull:.1f} | {middle:.1f} | {low:.1f} to {high:.1f} |")
