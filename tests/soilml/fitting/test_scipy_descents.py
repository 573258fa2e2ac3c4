"""Descents of least squares: warm starts, few linearisations, and the same optimum."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import CHANNELS, measured, two_gears, with_model
from scipy.stats import qmc

from soilml import identify
from soilml.fitting import least_squares, scipy_descents
from soilml.fitting.coordinates import select_free
from soilml.fitting.misfit import FEW, WeightedRows, _few_rows
from soilml.fitting.predictions import linearise
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics import sinkage_search


def weighted_rows(case, table):
    return WeightedRows.of(case, usable_readings(case, table), select_free(case, None))


def problem_of(case, table):
    return weighted_rows(case, table).problem


@pytest.mark.parametrize("gears", [1, 2])
def test_a_linearisation_near_another_is_the_same_without_a_search(tmp_path, monkeypatch, gears):
    case = with_model(tmp_path)
    rng = np.random.default_rng(2)
    gear = None
    if gears == 2:
        case, gear = two_gears(case), np.asarray(["narrow", "wide"] * 10)
    problem = problem_of(case, measured(case, rng, 20, gear=gear))
    u = np.asarray([0.4, 0.5, 0.3])

    def linearised(x, near=None):
        return linearise(problem.case, problem.coordinates, x, problem.readings, near)

    near, cold = linearised(u - 0.05), linearised(u)
    searches = []
    search = sinkage_search.coarse_estimate
    monkeypatch.setattr(
        sinkage_search, "coarse_estimate", lambda c: searches.append(1) or search(c)
    )
    warm = linearised(u, near)
    assert searches == []
    assert warm.prediction == pytest.approx(cold.prediction, rel=1e-9)
    assert warm.jacobian == pytest.approx(cold.jacobian, rel=1e-6, abs=1e-6)
    expected = linearised(u + 1e-5).log_sinkage
    moved = warm.sinkage_at(np.full((1, 3), 1e-5)).log_sinkage[0]
    assert moved == pytest.approx(expected, abs=1e-8)


def test_sixty_four_rows_take_few_linearisations(tmp_path, monkeypatch):
    case = with_model(tmp_path)
    table = measured(case, np.random.default_rng(5), 64)
    calls, sets = [], []
    whole, predict = least_squares.linearise, least_squares.predict
    monkeypatch.setattr(least_squares, "linearise", lambda *a: calls.append(1) or whole(*a))
    monkeypatch.setattr(
        least_squares,
        "predict",
        lambda c, f, x, rows: sets.append(len(x) * rows.row_count) or predict(c, f, x, rows),
    )
    identify(case, table, method="nonlinear")
    few = len(calls)
    assert sum(sets) <= 65 * 3 * FEW
    calls.clear()
    monkeypatch.setattr(scipy_descents, "NEARLY_SAME", 0.0)
    monkeypatch.setattr(scipy_descents, "START_TOLERANCE", scipy_descents.TOLERANCE)
    identify(case, table, method="nonlinear")
    assert few <= len(calls) - 3


def test_few_rows_for_the_starts_hold_all_channels_and_the_heaviest_load(tmp_path):
    case = with_model(tmp_path)
    table = measured(case, np.random.default_rng(6), 300)
    sinkage = np.where(np.arange(300) % 100 == 7, table["sinkage_m"], np.nan)
    columns = {name: table[name] for name in table.columns} | {"sinkage_m": sinkage}
    data = usable_readings(case, Table(columns))
    rows = _few_rows(data)
    assert {7, 107, 207} <= set(rows.tolist())
    assert data.row_load[rows].max() == data.row_load.max()
    assert len(rows) <= 2 * FEW + 3


@pytest.mark.slow
def test_the_optimum_is_the_lowest_of_descents_from_all_points(tmp_path):
    case = with_model(tmp_path)
    case = replace(case, prior=case.prior | {"n": Prior(0.5, 1.4)})
    for seed in range(3):
        rng = np.random.default_rng(seed)
        channels = list(CHANNELS)[: 1 + seed % 3]
        rows = weighted_rows(case, measured(case, rng, 24, channels))
        problem, few = rows.problem, rows.of_few_rows().problem
        found = scipy_descents.global_optimum(problem, few)
        points, _ = scipy_descents._ranked_starts(few)
        lowest = min(scipy_descents.descend(problem, point).cost for point in points[::13])
        assert found.cost <= lowest + scipy_descents.EQUAL_COST


def test_a_descent_that_comes_to_a_known_optimum_ends_there(tmp_path, monkeypatch):
    case = with_model(tmp_path)
    problem = problem_of(case, measured(case, np.random.default_rng(8), 40))
    known = scipy_descents.descend(problem, np.full(3, 0.5))
    calls = []
    whole = least_squares.linearise
    monkeypatch.setattr(least_squares, "linearise", lambda *a: calls.append(1) or whole(*a))
    again = scipy_descents.descend(problem, np.full(3, 0.3))
    alone = len(calls)
    calls.clear()
    assert scipy_descents.descend(problem, np.full(3, 0.3), known=known) is known
    assert len(calls) < alone
    assert np.abs(again.x - known.x).max() < scipy_descents.SAME_OPTIMUM
    elsewhere = replace(known, x=1.0 - known.x)
    other = scipy_descents.descend(problem, np.full(3, 0.3), known=elsewhere)
    assert other.x == pytest.approx(known.x, abs=scipy_descents.SAME_OPTIMUM)


@pytest.mark.parametrize("dimensions", range(1, scipy_descents.MOST_DIMENSIONS + 3))
def test_points_are_those_of_scipy(dimensions):
    points = scipy_descents.sobol_points(dimensions)
    assert points.shape == (scipy_descents.POINTS, dimensions) and points.dtype == np.float64
    expected = qmc.Sobol(dimensions, scramble=True, rng=7).random(scipy_descents.POINTS)
    np.testing.assert_array_equal(points, expected)
