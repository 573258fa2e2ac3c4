"""How far a stream, row by row, is from one call with all rows: `python bench/stream_order.py`.

Errors of the model and the sensors are linearised at the soil that is known when a row arrives, in
one call at that of all rows. Rows that are kept as they were read give the answer of one call.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from benchmarks_file import ROOT
from wrong_worlds import WORLDS, simulate

from soilml import Estimator
from soilml.io.text_tables import format_table

#: Rows that are kept, number of rows, and sets; the seed of all.
CASES, SEED = ((0, 16, 1000), (0, 48, 200), (32, 48, 200), (64, 48, 50), (64, 100, 100)), 5


def distances(estimator: Estimator, rows: int, sets: int, keep: int) -> np.ndarray:
    """Distance of c, phi and K in standard deviations of the one call, (sets, 3)."""
    drives, found = simulate(WORLDS[0], sets, rows, SEED), []
    for i in range(sets):
        readings = {k: drives.readings[k][i] for k in ("slip", "torque", "load")}
        whole, state = estimator.run(**readings), estimator.start(keep)
        for j in range(rows):
            last, state = estimator.step(state, **{k: v[j] for k, v in readings.items()})
        found.append(np.abs(last.mean - whole.mean) / whole.std)
    return np.asarray(found)


def main() -> None:
    """Print a line for each case and size of the model's errors."""
    estimator, lines = Estimator.load(ROOT / "exported" / "wheel.onnx"), []
    for name, own in (("averaged", estimator), ("0", estimator.on(model_error=0.0))):
        for keep, rows, sets in CASES:
            median, most = np.quantile(distances(own, rows, sets, keep), [0.5, 0.99])
            numbers = str(keep), str(rows), str(sets), f"{median:.3f}", f"{most:.3f}"
            lines.append((name, *numbers))
            print(*lines[-1], flush=True, file=sys.stderr)
    print(format_table(("model_error", "kept", "rows", "sets", "median", "99 %"), lines))


if __name__ == "__main__":
    main()
