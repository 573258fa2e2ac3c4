"""Change points, standard errors and tares on series whose truth is known."""

import itertools

import numpy as np
import pytest
from simulated_rig import wandering

from soilml.log_import.mapping.log_map import WindowSettings
from soilml.log_import.rows import WindowRow, irregular_windows
from soilml.log_import.windows.change_points import change_points, steady_pieces, without_transients
from soilml.log_import.windows.mean_errors import mean_error, pooled_errors, time_and_window
from soilml.log_import.windows.slip_errors import travel_ratio
from soilml.log_import.windows.steady import Stretch, steady_windows


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


def test_the_autocorrelation_time_is_that_of_the_process():
    values = wandering(np.random.default_rng(8), 20000, 1.0, 1.0, 10.0)
    assert time_and_window(values)[0] == pytest.approx(20.0, rel=0.2)
    assert time_and_window(np.random.default_rng(8).standard_normal(20000))[0] < 1.2


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


def test_errors_are_drawn_to_the_usual_one():
    errors, lengths = np.array([1.0, 1.0, 1.0, 1.0, 4.0, np.nan]), np.ones(6)
    pooled = pooled_errors(errors, lengths)
    assert pooled[0] == pytest.approx(1.0) and np.isnan(pooled[5])
    assert pooled[4] == pytest.approx(np.sqrt((8 * 16 + 4) / 12))
    np.testing.assert_array_equal(pooled_errors(errors[:3], lengths[:3]), errors[:3])


def test_settling_is_cut_off_and_a_steady_stretch_is_kept():
    rng = np.random.default_rng(10)
    time = 0.02 * np.arange(1000)
    steady = 1.0 + 0.02 * rng.standard_normal(1000)
    start, stop = without_transients(time, {"torque": steady}, 0.0, time[-1])
    assert start < 3.0 and stop > 17.0
    settling = steady + np.exp(-time / 0.8)
    start, stop = without_transients(time, {"torque": settling}, 0.0, time[-1])
    assert 1.5 < start < 5.0 and stop > 17.0


def test_what_is_left_out_has_a_reason():
    rng = np.random.default_rng(11)
    time = 0.02 * np.arange(1500)
    rim = np.where(time < 4.0, 0.0, np.where(time < 5.2, 0.1, 0.05))
    torque = 20.0 * rim + 0.01 * rng.standard_normal(time.size)
    torque[(time > 20.0) & (time < 27.0)] = np.nan
    slip = np.where(time > 15.0, np.nan, 0.2)
    found = steady_windows(
        time, {"rim_speed": rim, "slip": slip, "torque": torque}, WindowSettings()
    )
    why = [stretch.why for stretch in found]
    assert why[0].text == "the wheel is at rest"
    assert any(w and w.code == "too-short" for w in why)
    assert any(w and w.code == "missing-samples" and w.about == ("slip",) for w in why)


def test_a_window_that_wanders_far_more_than_the_others_is_irregular():
    def row(error):
        return WindowRow(Stretch(0.0, 9.0), {}, {"slip": 0.2}, {"slip": error})

    usual = [row(0.004 + 0.0005 * k) for k in range(5)]
    found = irregular_windows([[*usual, row(0.05)], [row(0.02)]])
    assert list(found) == [(0, 5)] and "the slip wanders 9.5 times" in found[(0, 5)].text
    assert irregular_windows([[row(0.004), row(0.049)]]) == {}
    # few windows: by what no rig shows, and whatever the other runs are
    alone = irregular_windows([[row(0.004), row(0.06)]])
    among = irregular_windows([[row(0.004), row(0.06)], [*usual, *usual]])
    assert [*alone] == [*among] == [(0, 1)] and alone[(0, 1)].code == "irregular"


def test_a_slow_drift_gives_no_window_with_a_wrong_mean():
    time = 0.02 * np.arange(2000)
    noise = 0.01 * np.random.default_rng(12).standard_normal(time.size)
    slip = 0.6 * time / time[-1]
    found = steady_windows(
        time,
        {"rim_speed": np.full(2000, 0.05), "slip": slip, "torque": 5.0 * slip + noise},
        WindowSettings(),
    )
    for window in found:
        if not window.why:
            inside = slip[(time >= window.start) & (time <= window.stop)]
            assert np.ptp(inside) < 0.09
