"""Parts of the tracker that need no model: limits, rows in question, repeated readings, window."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import chi2, norm

from soilml.onboard.memory import Memory
from soilml.onboard.tracking.filter_state import MOST_ROWS, RepeatedReadings, RowsInQuestion
from soilml.onboard.tracking.misfit import (
    QUANTILE,
    chi_squared_limit,
    excess_noise,
    over_median,
    usual_excess,
)
from soilml.onboard.tracking.row_window import BLOCKS, LEAST_ROWS, RECENT_ROWS, RowWindow


def row(torque, slip=0.3, load=60.0):
    values = {"slip": slip, "torque": torque, "load": load, "sinkage": 1.0, "drawbar_pull": 1.0}
    stds = {"torque_std": 0.1, "sinkage_std": 1e6, "drawbar_pull_std": 1e6}
    return {name: np.asarray([value]) for name, value in (values | stds).items()}


@pytest.mark.parametrize("degrees", [1.0, 3.0, 4.0, 21.0])
def test_limits_are_quantiles_of_chi_squared(degrees):
    exact = chi2.isf(norm.sf(QUANTILE), degrees)
    assert exact < chi_squared_limit(degrees) < 1.1 * exact


def test_noise_is_judged_by_most_rows_and_never_taken_for_less_than_stated():
    assert excess_noise(300.0, 103.0, 3) == pytest.approx(308.0 / 108.0)
    assert usual_excess([0.1] * 16) == usual_excess([]) == 1.0
    assert usual_excess([1.0] * 10 + [900.0] * 5) == 1.0
    assert usual_excess([5.0] * 16) == 5.0 and usual_excess([900.0] * 16) == 10.0
    draws = np.random.default_rng(0).chisquare(3.0, 4001)
    assert np.median([over_median(x, 3.0) for x in draws]) == pytest.approx(1.0, rel=0.05)


def test_rows_in_question_begin_with_one_that_disagrees():
    rows = RowsInQuestion().with_row(row(1.0), True)
    for torque in range(2, MOST_ROWS + 1):
        rows = rows.with_row(row(float(torque)), torque == 4)
    assert (rows.count, len(rows.rows)) == (2, MOST_ROWS)
    rows = rows.with_row(row(9.0), False)
    assert (rows.count, rows.rows[0]["torque"][0]) == (1, 4.0)
    for _ in range(MOST_ROWS):
        rows = rows.with_row(row(1.0), False)
    assert (rows.count, rows.rows) == (0, ())


def test_three_rows_that_disagree_may_be_of_another_soil():
    rows = RowsInQuestion()
    for torque, disagrees in [(1.0, True), (2.0, False), (3.0, True), (4.0, True)]:
        assert rows.candidates() == []
        rows = rows.with_row(row(torque), disagrees)
    assert [part["torque"].tolist() for part in rows.candidates()] == [[1.0, 2.0, 3.0, 4.0]]
    rows = rows.with_row(row(5.0), True)
    parts = [part["torque"].tolist() for part in rows.candidates()]
    assert parts == [[1.0, 2.0, 3.0, 4.0, 5.0], [3.0, 4.0, 5.0]]
    kept = rows.without_reading("torque", 4.0)
    assert [r["torque"][0] for r in kept.rows] == [1.0, 2.0, 3.0, 5.0]


def test_a_reading_that_repeats_twice_is_stuck_unless_the_whole_row_repeats():
    seen = RepeatedReadings().with_row(row(2.0))
    assert seen.repeats(row(2.0)) and not seen.repeats(row(2.0, slip=0.31))
    seen = seen.with_row(row(2.0, slip=0.31))
    assert seen.stuck is None
    assert seen.with_row(row(2.0, slip=0.32)).stuck == "torque"
    assert seen.with_row(row(2.1, slip=0.32)).stuck is None


def test_a_window_forgets_whole_blocks_and_keeps_the_likelihood_of_the_others():
    rng = np.random.default_rng(0)
    start = Memory(np.zeros((0, 3), np.float32), np.zeros(3, np.float32))
    length = 3 * BLOCKS
    window, kept = RowWindow.empty(start, length), []
    for _ in range(4 * length):
        added = rng.standard_normal((1, 3)).astype(np.float32)
        kept.append(added[0])
        system = np.concatenate([window.memory.system, added])
        window = window.with_rows({}, Memory(system, window.memory.counts + 1.0))
        if window.is_full:
            window = window.since(1)
        count = window.memory.rows
        assert count == min(len(kept), count) and (len(kept) < length or count >= length)
        assert count <= length + window.rows_per_block
    last = np.asarray(kept[-count:])
    system = window.memory.system
    assert len(system) == 3
    assert system.T @ system == pytest.approx(last.T @ last, rel=1e-4, abs=1e-3)
    half = np.asarray(kept[-window.since(4).memory.rows :])
    system = window.since(4).memory.system
    assert system.T @ system == pytest.approx(half.T @ half, rel=1e-4, abs=1e-3)


def test_another_soil_is_suspected_where_rows_began_to_add_more():
    start = Memory(np.zeros((0, 3), np.float32), np.zeros(3, np.float32))
    window = RowWindow.empty(start, 100)
    for i in range(60):
        system = np.concatenate([window.memory.system, np.ones((1, 3))])
        window = window.with_rows({}, Memory(system, window.memory.counts + 1.0), 5.0 * (i >= 53))
    assert len(window.added) == RECENT_ROWS and window.memory.rows == 60
    assert window.since(window.suspect(1.0)).memory.rows == 7
    assert window.with_another_soil().suspect(1.0) == len(window.blocks) - LEAST_ROWS


def test_the_tracker_needs_numpy_and_onnxruntime_only():
    code = (
        "import sys, soilml; before = set(sys.modules); soilml.SoilTracker;"
        "print(*{m.split('.')[0] for m in set(sys.modules) - before})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"soilml", "numpy", "onnxruntime"} <= loaded
    ground = {"scipy", "sklearn", "torch", "pyarrow", "onnx", "jinja2", "datagen", "training"}
    assert not loaded & ground
