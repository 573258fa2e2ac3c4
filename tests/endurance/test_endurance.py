"""Some thousand of the steps of `make endurance`."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from endurance_run import run_day

from soilml.onboard.estimator import Estimator

ROOT = Path(__file__).parents[2]

#: Prints the resident memory of the later soils above that of the earlier ones, bytes, by medians.
#: The halves are 500 readings apart, whose memories alone are 9 MB. It is a process of its own:
#: one that has run other tests takes from what they have left.
GROWTH = """
import sys
import numpy as np
from endurance_run import run_day
from soilml.onboard import Estimator

kept, step = [], Estimator.step

def leaking(self, memory, **readings):
    estimate, memory = step(self, memory, **readings)
    kept.append(memory)
    return estimate, memory

run_day(steps=250, per_soil=250, seed=3)  # warms up
if sys.argv[1] == "leaking":
    Estimator.step = leaking
resident = run_day(steps=1000, per_soil=250, seed=4).resident
half = len(resident) // 2
print(np.median(resident[half:]) - np.median(resident[:half]))
"""


def growth(kind):
    done = subprocess.run(
        [sys.executable, "-c", GROWTH, kind],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


@pytest.mark.long
def test_estimates_do_not_drift():
    result = run_day(steps=4000, per_soil=2000, seed=3)
    columns = Estimator.load(ROOT / "exported" / "wheel.onnx").sets.columns
    assert max(result.bytes_of_memory) <= 8 * columns**2 + 4 * 3  # a square system, and counts
    assert result.counts["refused"] == result.counts["not finite"] + result.counts["impossible"] > 0
    assert result.flagged == 0
    assert np.max(result.errors) < 5.0
    assert np.max(result.drifts) < 0.2


@pytest.mark.slow
def test_resident_memory_is_flat():
    assert growth("sound") < 2e6
