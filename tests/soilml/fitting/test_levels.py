"""Levels: values within their scatter are one, distinct ones are counted, ranges are wide."""

import numpy as np
import pytest

from soilml.fitting.levels import (
    is_one_load,
    load_levels,
    replicate_rows,
    slip_levels,
)
from soilml.physics.operating_point import Operating

SEEDS = 100


def share(draw, count):
    """Share of seeds in which `draw(rng)` has so many load levels."""
    found = [load_levels(*draw(np.random.default_rng(s))).count for s in range(SEEDS)]
    return np.mean(np.asarray(found) == count)


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.003, 0.02, 0.08])
@pytest.mark.parametrize("runs", [2, 4, 16, 64])
def test_loads_that_scatter_about_one_value_are_one_level(scatter, runs):
    run = np.repeat(np.arange(runs), 8)
    by_run = share(lambda g: (20.0 * (1.0 + g.uniform(-scatter, scatter, runs))[run], run), 1)
    by_row = share(lambda g: (20.0 * (1.0 + scatter * g.standard_normal(run.size)), run), 1)
    assert min(by_run, by_row) >= 0.93


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_spaced_loads_with_jitter_are_counted(count):
    loads = np.geomspace(30.0, 120.0, count)
    run = np.repeat(np.arange(2 * count), 8)
    base = np.tile(loads, 2)[run]
    assert share(lambda g: (base * (1.0 + 0.03 * g.standard_normal(run.size)), run), count) >= 0.95
    once = np.repeat(np.arange(count), 8)
    assert (
        share(lambda g: ((loads * (1 + 0.03 * g.standard_normal(count)))[once], once), count) > 0.9
    )


def test_a_range_without_gaps_has_several_levels_that_cover_it():
    load = np.random.default_rng(0).uniform(13.0, 30.0, 64)
    levels = load_levels(load, np.arange(64))
    assert levels.count >= 3 and not is_one_load(load)
    assert np.all(np.diff(levels.index[np.argsort(load)]) >= 0)
    assert set(levels.index) == set(range(levels.count))


@pytest.mark.parametrize(("count", "levels"), [(9, 1), (11, 2)])
def test_a_range_is_one_level_up_to_the_scatter_that_chance_gives(count, levels):
    """Standard deviations 0.0137 and 0.0166; the limits are 0.0158 and 0.0152."""
    assert slip_levels(0.1 + 0.005 * np.arange(count)).count == levels


def test_repeats_show_levels_that_are_set_more_finely():
    load = np.repeat([60.0, 64.0, 60.0, 64.0], 8)
    repeated = np.repeat(np.arange(4), 8)
    assert load_levels(load, repeated).count == 2
    assert load_levels(load, repeated % 2).count == 1  # one run of each: may be its scatter


def test_rows_are_driven_alike_where_all_that_is_set_agrees():
    at = Operating(
        slip=np.asarray([0.30, 0.305, 0.30, 0.30, 0.45]),
        load=np.asarray([60.0, 61.0, 60.5, 90.0, 60.0]),
        speed=np.asarray([0.05, 0.05, -0.05, 0.05, 0.05]),
    )
    group = replicate_rows(at)
    assert group[0] == group[1]
    assert len(set(group.tolist())) == 4


def test_rows_of_a_range_are_alike_only_where_they_are_close():
    load = np.linspace(13.0, 30.0, 64)
    group = replicate_rows(Operating(slip=np.full(64, 0.3), load=load))
    widths = [np.ptp(np.log(load[group == i])) for i in range(group.max() + 1)]
    assert max(widths) <= 0.0501 and group.max() > 10


def test_rows_of_different_gears_or_passes_are_no_repeats():
    at = Operating(
        slip=np.asarray([0.2, 0.2, 0.2, 0.2, 0.5]),
        load=np.full(5, 60.0),
        gear=np.asarray(["wide", "lugged", "wide", "wide", "wide"]),
        pass_number=np.asarray([1.0, 1.0, 1.0, 2.0, 1.0]),
    )
    found = replicate_rows(at, np.arange(5))
    assert found.dtype == np.int64
    assert found[0] == found[2] and len(set(found.tolist())) == 4
