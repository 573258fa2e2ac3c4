"""Descents of least squares: warm starts, few linearisations, and the same optimum."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml import Operating, identify, read_case
from soilml.fitting import descent
from soilml.fitting.channel_predictions import linearise
from soilml.fitting.free_parameters import select_free
from soilml.fitting.observations import read_observations
from soilml.fitting.spread_rows import READINGS, spread_rows
from soilml.identification.nonlinear import least_squares_problem
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


def problem_of(case, table):
    return least_squares_problem(case, read_observations(case, table), select_free(case, None))


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
    at = [problem.case, problem.data, problem.free]
    u = np.asarray([0.4, 0.5, 0.3])
    near = linearise(*at, u - 0.05)
    cold = linearise(*at, u)
    searches = []
    search = sinkage_search.coarse_estimate
    monkeypatch.setattr(
        sinkage_search, "coarse_estimate", lambda c: searches.append(1) or search(c)
    )
    warm = linearise(*at, u, near)
    assert searches == []
    assert warm.prediction == pytest.approx(cold.prediction, rel=1e-9)
    assert warm.jacobian == pytest.approx(cold.jacobian, rel=1e-6, abs=1e-6)
    expected = linearise(*at, u + 1e-5).log_sinkage
    assert warm.sinkage_at(u + 1e-5).log_sinkage == pytest.approx(expected, abs=1e-8)


def test_sixty_four_rows_take_few_linearisations(tmp_path, monkeypatch):
    case = with_model(tmp_path)
    table = measured(case, np.random.default_rng(5), 64)
    calls, sets = [], []
    whole, predict = descent.linearise, descent.predict_channels
    monkeypatch.setattr(descent, "linearise", lambda *a: calls.append(1) or whole(*a))
    monkeypatch.setattr(
        descent,
        "predict_channels",
        lambda c, f, u, at: sets.append(len(u) * np.size(at.slip)) or predict(c, f, u, at),
    )
    identify(case, table)
    few = len(calls)
    assert sum(sets) <= 65 * 3 * READINGS
    calls.clear()
    monkeypatch.setattr(descent, "NEARLY_SAME", 0.0)
    monkeypatch.setattr(descent, "START_TOLERANCE", descent.TOLERANCE)
    identify(case, table)
    assert few <= len(calls) - 3


def test_few_rows_for_the_starts_hold_all_channels_and_the_heaviest_load(tmp_path):
    case = with_model(tmp_path)
    table = measured(case, np.random.default_rng(6), 300)
    sinkage = np.where(np.arange(300) % 100 == 7, table["sinkage_m"], np.nan)
    columns = {name: table[name] for name in table.columns} | {"sinkage_m": sinkage}
    data = read_observations(case, Table(columns))
    rows = spread_rows(data)
    assert {7, 107, 207} <= set(rows.tolist())
    assert data.load[rows].max() == data.load.max()
    assert len(rows) <= 2 * READINGS + 3


@pytest.mark.slow
def test_the_optimum_is_the_lowest_of_descents_from_all_points(tmp_path):
    case = with_model(tmp_path)
    case = replace(case, prior=case.prior | {"n": Prior(0.5, 1.4)})
    for seed in range(3):
        rng = np.random.default_rng(seed)
        channels = list(CHANNELS)[: 1 + seed % 3]
        problem = problem_of(case, measured(case, rng, 24, channels))
        found = descent.global_optimum(problem)
        starts, _ = descent._ranked_starts(problem)
        lowest = min(descent.descend(problem, start).cost for start in starts[::13])
        assert found.cost <= lowest + descent.EQUAL_COST


def test_a_descent_that_comes_to_a_known_optimum_ends_there(tmp_path, monkeypatch):
    case = with_model(tmp_path)
    problem = problem_of(case, measured(case, np.random.default_rng(8), 40))
    known = descent.descend(problem, np.full(3, 0.5))
    calls = []
    whole = descent.linearise
    monkeypatch.setattr(descent, "linearise", lambda *a: calls.append(1) or whole(*a))
    again = descent.descend(problem, np.full(3, 0.3))
    alone = len(calls)
    calls.clear()
    assert descent.descend(problem, np.full(3, 0.3), known=known) is known
    assert len(calls) < alone
    assert np.abs(again.u - known.u).max() < descent.SAME_OPTIMUM
    elsewhere = replace(known, u=1.0 - known.u)
    other = descent.descend(problem, np.full(3, 0.3), known=elsewhere)
    assert other.u == pytest.approx(known.u, abs=descent.SAME_OPTIMUM)
