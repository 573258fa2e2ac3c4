"""Thousands of readings, one by one: neither memory nor the estimate drifts."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from simulated_rows import rows_of

from soilml.errors import InputError
from soilml.onboard import Estimator

#: Prints by how many bytes the resident memory grows over 750 readings, whose memories alone would
#: take 13 MB. It is a process of its own: one that has run other tests takes from what they left.
GROWTH = """
import gc
from pathlib import Path
import numpy as np
from simulated_rows import rows_of
from soilml.onboard import Estimator

def resident():
    gc.collect()
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

estimator = Estimator.load("wheel").on(model_error=0.0)
rows, memory = rows_of(np.random.default_rng(4), 1000, None, ()), estimator.start()
for i in range(1000):
    before = resident() if i == 250 else before if i > 250 else 0
    row = {name: float(rows[name][i]) for name in ("slip", "torque", "load")}
    _, memory = estimator.step(memory, **row)
print(resident() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc")
def test_resident_memory_is_flat():
    done = subprocess.run(
        [sys.executable, "-c", GROWTH],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert float(done.stdout) < 2e6


@pytest.mark.long
def test_steps_give_the_estimate_of_one_call_and_readings_that_are_refused_change_nothing():
    # errors of the model are linearised at the soil that is known when a row arrives
    estimator = Estimator.load("wheel").on(model_error=0.0)
    rows = rows_of(np.random.default_rng(3), 2000, None, ())
    rows = {name: rows[name].astype(float) for name in ("slip", "torque", "load")}
    rows["torque"][500::100], rows["load"][550::100] = np.nan, -60.0
    memory, read = estimator.start(), []
    for i in range(2000):
        try:
            found, memory = estimator.step(memory, **{n: float(v[i]) for n, v in rows.items()})
        except InputError:
            continue
        read.append(i)
        assert np.isfinite(found.mean).all()
    assert len(read) == 2000 - 15 - 15
    columns = estimator.sets.columns
    assert memory.system.nbytes + memory.counts.nbytes <= 8 * columns**2 + 4 * 3
    whole = estimator.run(**{name: values[read] for name, values in rows.items()})
    assert found.in_range and (np.abs(found.mean - whole.mean) < 0.2 * whole.std).all()
