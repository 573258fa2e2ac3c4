"""Evaluation of the sensor signals of a tracked robot."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from soilml.systems.tracked_robot import stationary_mean


def remembered(count, memory, rng):
    """Noise of unit variance that forgets within `memory` samples."""
    keep = np.exp(-1.0 / memory)
    steps = rng.standard_normal(count) * np.sqrt(1.0 - keep**2)
    return scipy_signal.lfilter([1.0], [1.0, -keep], steps)


@pytest.mark.parametrize("memory", [0.3, 8.0])
def test_the_standard_error_accounts_for_correlated_noise(memory):
    rng = np.random.default_rng(1)
    off, message = [], []
    for _ in range(150):
        found = stationary_mean(600.0 + 20.0 * remembered(4000, memory, rng))
        off.append(found.mean - 600.0)
        message.append(found.std_error)
    ratio = np.sqrt(np.mean(np.square(off)) / np.mean(np.square(message)))
    assert 0.8 < ratio < 1.35  # scatter of samples would say 4 times too little at 8


def test_ramps_before_and_after_the_pull_are_excluded():
    rng = np.random.default_rng(2)
    pull = np.concatenate(
        [np.zeros(800), np.linspace(0, 620, 900), np.full(3000, 620.0), np.linspace(620, 0, 400)]
    )
    pull = pull + 15.0 * remembered(len(pull), 5.0, rng)
    found = stationary_mean(pull, above=50.0)
    assert 1600 <= found.start < found.stop <= 4800 and found.stop - found.start > 1500
    assert abs(found.mean - 620.0) < 4.0 * found.std_error < 10.0
    assert stationary_mean(pull[:900]).mean == pytest.approx(
        0.0, abs=8.0
    )  # waiting stands still too
