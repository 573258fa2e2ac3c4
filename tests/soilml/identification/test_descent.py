"""Descents of least squares: warm starts, few linearisations, and the same optimum."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml import Operating, identify, read_case
from soilml.fitting import least_squares, starts
from soilml.fitting.coordinates import select_free
from soilml.fitting.predictions import linearise
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.nonlinear import FEW, WeightedRows, _few_rows
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics import sinkage_search

CHANNELS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}


def with_model(tmp_path, text=THREE_CHANNEL_MODEL):
    path = tmp_path / "model.toml"
    path.write_text(text)
    return read_case(path)


def measured(case, rng, rows, channels=CHANNELS, gear=None, least_slip=-0.05):
    """Readings with the noise of the case, of a soil drawn from its priors."""
    true = case.with_values({n: float(p.at(rng.random())) for n, p in case.prior.items()})
    slip, load = rng.uniform(least_slip, 0.6, rows), rng.choice([35.0, 60.0, 85.0, 110.0], rows)
    columns = {"slip": slip, "load_N": load}
    models = {None: true.model, **true.gears}
    for key in channels:
        value = np.empty(rows)
        for name in np.unique(gear) if gear is not None else [None]:
            own = slice(None) if gear is None else gear == name
            at = Operating(slip=slip[own], load=load[own])
            value[own] = getattr(models[name](true.soil, at), CHANNELS[key])
        columns[key] = value + case.noise[key].std(value) * rng.standard_normal(rows)
    return Table(columns if gear is None else {"gear": gear, **columns})


def weighted_rows(case, table):
    return WeightedRows.of(case, usable_readings(case, table), select_free(case, None))


def problem_of(case, table):
    return weighted_rows(case, table).problem


def two_gears(case):
    wheel = case.model.gear
    wide = replace(case.model, gear=replace(wheel, width=0.2))
    return replace(case, gears={"narrow": case.model, "wide": wide})


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
    identify(case, table)
    few = len(calls)
    assert sum(sets) <= 65 * 3 * FEW
    calls.clear()
    monkeypatch.setattr(starts, "NEARLY_SAME", 0.0)
    monkeypatch.setattr(starts, "START_TOLERANCE", starts.TOLERANCE)
    identify(case, table)
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
        found = starts.global_optimum(problem, few)
        points, _ = starts._ranked_starts(few)
        lowest = min(starts.descend(problem, point).cost for point in points[::13])
        assert found.cost <= lowest + starts.EQUAL_COST


def test_a_descent_that_comes_to_a_known_optimum_ends_there(tmp_path, monkeypatch):
    case = with_model(tmp_path)
    problem = problem_of(case, measured(case, np.random.default_rng(8), 40))
    known = starts.descend(problem, np.full(3, 0.5))
    calls = []
    whole = least_squares.linearise
    monkeypatch.setattr(least_squares, "linearise", lambda *a: calls.append(1) or whole(*a))
    again = starts.descend(problem, np.full(3, 0.3))
    alone = len(calls)
    calls.clear()
    assert starts.descend(problem, np.full(3, 0.3), known=known) is known
    assert len(calls) < alone
    assert np.abs(again.x - known.x).max() < starts.SAME_OPTIMUM
    elsewhere = replace(known, x=1.0 - known.x)
    other = starts.descend(problem, np.full(3, 0.3), known=elsewhere)
    assert other.x == pytest.approx(known.x, abs=starts.SAME_OPTIMUM)
