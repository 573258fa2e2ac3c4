"""Change points, standard errors and tares on series whose truth is known."""

import itertools

import numpy as np
import pytest
from simulated_rig import wandering

from soilml.log_import.windows.change_points import change_points, steady_pieces
from soilml.log_import.windows.mean_errors import mean_error, travel_ratio


def test_change_points_are_the_exact_optimum():
    """Against all divisions of a short series."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal((11, 2)) + np.where(np.arange(11) > 6, 2.0, 0.0)[:, None]

    def cost(changes):
        ends = [0, *changes, len(values)]
        parts = [values[a:b] for a, b in itertools.pairwise(ends)]
        if min(map(len, parts)) < 2:
            return np.inf
        return sum(np.sum((p - p.mean(axis=0)) ** 2) + 3.0 for p in parts)

    options = [
        changes
        for count in range(5)
        for changes in itertools.combinations(range(1, len(values)), count)
    ]
    assert tuple(change_points(values, 3.0, shortest=2)) == min(options, key=cost)


def test_steps_are_found_in_correlated_noise_and_none_where_there_are_none():
    rng = np.random.default_rng(6)
    noise = np.stack([wandering(rng, 480, 0.1, 1.0, 0.4) for _ in range(2)], axis=1)
    least = np.full(2, 1e-6)
    assert steady_pieces(noise, least) == [(0, 480)]
    stepped = noise + np.repeat([0.0, 4.0, 8.0], 160)[:, None]
    starts = [a for a, _ in steady_pieces(stepped, least)]
    assert len(starts) == 3
    np.testing.assert_allclose(starts, [0, 160, 320], atol=4)


@pytest.mark.parametrize(
    ("memory", "noise", "seconds"), [(0.0, 1.0, 12), (0.3, 0.0, 12), (0.3, 1.0, 12), (0.1, 0.5, 30)]
)
def test_standard_errors_of_means_are_calibrated(memory, noise, seconds):
    """90 % intervals hold the true mean in 90 % of 400 series, within the error of that share."""
    rng = np.random.default_rng(7)
    n, scores = seconds * 50, []
    for _ in range(400):
        values = wandering(rng, n, 0.02, 1.0, memory) + noise * rng.standard_normal(n)
        mean, error, _ = mean_error(values, 0.02)
        scores.append(mean / error)
    assert np.mean(np.abs(scores) < 1.645) == pytest.approx(0.90, abs=0.05)
    assert 0.8 < np.std(scores) < 1.15


def test_a_ripple_does_not_hide_slow_noise():
    """Noise with a memory of 1 s under a ripple of 1 Hz, whose correlations end the sum early."""
    rng, scores, time = np.random.default_rng(17), [], np.arange(0.0, 20.0, 0.02)
    for _ in range(300):
        values = wandering(rng, time.size, 0.02, 1.0, 1.0)
        values += 1.3 * np.sin(2 * np.pi * (time + rng.random()))
        mean, error, _ = mean_error(values, 0.02)
        scores.append(mean / error)
    assert np.mean(np.abs(scores) < 1.645) > 0.84
    assert np.std(scores) < 1.15


@pytest.mark.slow
@pytest.mark.parametrize("blur, interval", [(0.0, 0), (0.0005, 0), (0.003, 0), (0.003, 0.2)])
def test_slip_from_places_is_calibrated(blur, interval):
    """Places in m with white noise, rotation exact, slip that wanders by 0.02.

    With `interval`, places come at 5 Hz and are interpolated: noise is no motion between them.
    """
    rng = np.random.default_rng(9)
    n, step, scores = 800, 0.02, []
    for _ in range(200):
        speed = 0.05 * (0.7 - wandering(rng, n, step, 0.02, 0.2))
        place = np.cumsum(speed) * step + blur * rng.standard_normal(n)
        if interval:
            time = step * np.arange(n)
            seen = slice(None, None, round(interval / step))
            place = np.interp(time, time[seen], place[seen])
        rim = 0.05 * step * np.arange(1, n + 1)
        ratio, error, rim_rate, rate = travel_ratio(step, rim, place, True, True, interval)
        scores.append((ratio - 0.7) / error)
    assert rim_rate == pytest.approx(0.05) and rate == pytest.approx(0.035, rel=0.1)
    assert np.mean(np.abs(scores) < 1.645) == pytest.approx(0.90, abs=0.09)
