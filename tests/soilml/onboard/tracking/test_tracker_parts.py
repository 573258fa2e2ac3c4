"""Parts of the tracker that need no model: limits, rows in question, repeated readings, window."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from soilml.onboard.memory import Memory
from soilml.onboard.tracking.misfit import (
    QUANTILE,
    chi_squared_limit,
    excess_noise,
    over_median,
    usual_excess,
)
from soilml.onboard.tracking.row_window import BLOCKS, RowWindow


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
