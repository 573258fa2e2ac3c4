"""Tables of many rows: a part of them, even over runs and loads, is fitted."""

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL
from gap_sets import case_of
from measured_rows import measured

from soilml import identify
from soilml.fitting import readings
from soilml.fitting.usable_readings import usable_readings

ROWS, FITTED = 1800, 450


@pytest.fixture
def case():
    return case_of(THREE_CHANNEL_MODEL)


def test_the_part_is_spread_over_the_table(case, monkeypatch):
    monkeypatch.setattr(readings, "MOST_FITTED_ROWS", FITTED)
    data = usable_readings(case, measured(case, np.random.default_rng(4), ROWS))
    part = data.thinned()
    row = np.asarray([int(np.flatnonzero(data.row_slip == slip)[0]) for slip in part.row_slip])
    assert FITTED - 4 < part.row_count == len(np.unique(row)) <= FITTED
    assert len(part) == 3 * part.row_count
    assert part.measured[part.channel == 0] == pytest.approx(data.measured[row])
    assert part.thinned() is part
    loads, counts = np.unique(part.row_load, return_counts=True)
    assert len(loads) == 4 and np.ptp(counts) == 0
    assert np.bincount(row * 4 // ROWS) == pytest.approx(FITTED / 4, abs=5)


@pytest.mark.parametrize("rows", [2001, 2500, 40_000])
def test_runs_of_few_rows_are_fitted_whole(rows):
    group = np.full(rows, 3)
    group[[0, 700, 1400]], group[5:30] = 1, 2
    part = readings.even_part(group, 2000)
    assert len(np.unique(part)) == len(part) and 1999 <= len(part) <= 2000
    assert np.bincount(group[part]).tolist()[1:3] == [3, 25]
    many = readings.even_part(np.arange(rows), 2000)
    assert len(np.unique(many)) == len(many) == 2000


@pytest.mark.slow
def test_the_soil_of_a_part_is_that_of_all_within_its_std(case, monkeypatch):
    table = measured(case, np.random.default_rng(11), ROWS, least_slip=0.05)
    whole = identify(case, table, method="nonlinear")
    monkeypatch.setattr(readings, "MOST_FITTED_ROWS", FITTED)
    part = identify(case, table, method="nonlinear")
    assert FITTED - 4 < part.rows_used <= FITTED
    thinned = ["rows-thinned" in {r.code for r in fit.warnings} for fit in (part, whole)]
    assert thinned == [True, False]
    assert np.abs((part.values - whole.values) / part.std).max() < 2.5
    assert part.std == pytest.approx(whole.std * np.sqrt(ROWS / part.rows_used), rel=0.15)
