"""Write runs.csv: a campaign on a wheel that digs itself in with slip, which model.toml lacks.

python examples/campaign/make.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from soilml import SlipSinkage, read_case, simulate
from soilml.io.text_tables import csv_text

FOLDER = Path(__file__).parent
LOADS = [40.0, 55.0, 70.0, 85.0, 100.0, 115.0]
COLUMNS = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
SLIPS = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5]


def run() -> None:
    """Simulate the campaign and write it."""
    case = read_case(FOLDER / "model.toml")
    world = replace(case, model=case.model + SlipSinkage(n1=0.4))
    slip, load = np.tile(SLIPS, len(LOADS)), np.repeat(LOADS, len(SLIPS))
    names = np.repeat([f"load_{load:.0f}" for load in LOADS], len(SLIPS))
    table = simulate(world, slip, load, run=names, seed=1)
    columns = {name: table[name] for name in COLUMNS}
    (FOLDER / "runs.csv").write_text(csv_text(columns))


if __name__ == "__main__":
    run()
