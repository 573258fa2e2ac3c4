"""Trends of residuals with the order of the runs, and with that of the rows of a run."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.least_squares import Solution
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import RUN_EFFECT_UNITS, run_effect_columns
from soilml.gap.evidence.directions import smooth_basis
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.evidence.score_test import score_test
from soilml.gap.report.results import SoilTrend
from soilml.numerics.subspaces import project_out

#: Family-wise level of the tests, and fewest runs whose order can show a trend: of five, one order
#: and its reverse are 1/60 of all.
TREND_LEVEL, FEWEST_RUNS = 0.02, 5
PERMUTATIONS = 4000  # Orders of the runs that are drawn
#: Share of the variance of an order that polynomials of slip and load of this degree may explain:
#: above it, rows were driven in the order of slip or load, and nothing tells the two apart.
MOST_EXPLAINED, DEGREE = 0.9, 2
#: Mean sign of the steps of slip, or load, along runs from which they count as sweeps.
MOST_ONE_WAY = 0.7
#: What changes in a trend, and the unit of its column among those of the run-to-run variation.
PARAMETERS = (
    ("friction angle", float(RUN_EFFECT_UNITS["friction_angle"])),
    ("bearing strength", RUN_EFFECT_UNITS["bearing"]),
)


def order_trends(problem: FitProblem, soil: Solution, seed: int) -> list[SoilTrend]:
    r"""Tests of a soil that changes evenly along the order of runs, or of a run's rows.

    .. math:: g_k(o) = P W (J_k o), \quad z = g_k(o) \cdot W r / |g_k(o)|

    with J_k the change of the readings with friction angle or bearing strength, o the centred
    order, W the whitening by noise and scatter from run to run, and P the projection off the soil
    and off smooth functions of slip and load. Along the runs, the p value is that of the largest
    score among all orders of the runs, which needs no knowledge of the scatter; along the rows of
    a run, scores are compared with those of noise. Both are family-wise, over parameters and
    orders.

    Empty where the order is that of slip or load, or runs are few.

    References: Edgington and Onghena, Randomization Tests, 2007, section 3.4; Rao, Proc. Cambridge
    Phil. Soc. 44, 1948 (score test).
    """
    readings = problem.readings
    among_runs, within = _orders(readings)
    tests = (among_runs is not None) + (within is not None)
    if not tests:
        return []
    columns = run_effect_columns(soil.fitted(), readings)
    whiten = problem.discrepancy.whiten(problem.declared_amplitude)
    fit = soil.whitened_by(whiten)
    explained = np.hstack([fit.jacobian, whiten @ smooth_basis(readings)])
    found = []
    if among_runs is not None:
        own = readings.run[readings.row][:, None] == np.arange(len(readings.runs))
        by_run = [
            project_out(whiten @ (columns[:, k : k + 1] * own), explained)
            for k in range(len(PARAMETERS))
        ]
        found += _along_runs(by_run, fit.residual, among_runs, tests, seed)
    if within is not None:
        trend = project_out(whiten @ (columns * within[readings.row][:, None]), explained)
        found += _along_rows(problem, trend, fit.residual, tests, seed)
    return sorted(found, key=lambda one: one.p)


def _along_runs(
    by_run: list[Floats], residual: Floats, order: Floats, tests: int, seed: int
) -> list[SoilTrend]:
    """Trends with the order of the runs, (runs,); `by_run` are columns (m, runs) by parameter."""
    rng = np.random.default_rng(seed)
    orders = np.vstack([order, rng.permuted(np.tile(order, (PERMUTATIONS, 1)), axis=1)])
    products = np.stack([orders @ (b.T @ residual) for b in by_run], axis=1)
    squares = np.stack([np.einsum("pr,rs,ps->p", orders, b.T @ b, orders) for b in by_run], axis=1)
    squares = np.maximum(squares, 1e-12)
    z = products / np.sqrt(squares)
    largest = np.abs(z[1:]).max(axis=1)
    return [
        _trend("runs", k, z[0, k], largest, products[0, k] / squares[0, k], tests)
        for k in range(len(by_run))
    ]


def _along_rows(
    problem: FitProblem, trend: Floats, residual: Floats, tests: int, seed: int
) -> list[SoilTrend]:
    """Trends with the order of the rows of each run; `trend` has the columns (m, parameters)."""
    test = score_test(
        residual,
        columns=trend,
        space=trend[:, :0],
        signs=np.zeros(trend.shape[1]),
        degrees_of_freedom=problem.covariance.components.degrees_of_freedom,
        seed=seed,
    )
    size = (trend.T @ residual) / np.maximum((trend**2).sum(axis=0), 1e-12)
    return [
        _trend("rows", k, float(np.copysign(z, size[k])), test.null_maxima, size[k], tests)
        for k, z in enumerate(test.z)
    ]


def _trend(order: str, k: int, z: float, null: Floats, units: float, tests: int) -> SoilTrend:
    name, unit = PARAMETERS[k]
    p = (float(np.sum(null >= abs(z) - 1e-9)) + 1.0) / (len(null) + 1.0)
    return SoilTrend(order, name, float(z), min(1.0, tests * p), float(units * unit))


def _orders(readings: Readings) -> tuple[Floats | None, Floats | None]:
    """Order of the runs (runs,), and of the rows in their runs (n,), from -1/2 to 1/2.

    By progress where it is known, else as the rows are listed; None for an order that slip and load
    explain, and for that of few runs.
    """
    progress = readings.at.progress
    time = np.arange(len(readings.run)) if progress is None else np.asarray(progress)
    runs = range(len(readings.runs))
    starts = np.asarray([np.mean(time[readings.run == r]) for r in runs])
    among_runs = np.argsort(np.argsort(starts, kind="stable")) / max(len(starts) - 1, 1) - 0.5
    longest = np.asarray([readings.order[readings.run == r].max() for r in runs])
    within = readings.order / np.maximum(longest, 1)[readings.run] - 0.5
    known = len(starts) >= FEWEST_RUNS and not _is_explained(readings, among_runs[readings.run])
    swept = _is_sweep(readings) or _is_explained(readings, within)
    return among_runs if known else None, None if swept else within


def _is_sweep(readings: Readings) -> bool:
    """Whether slip or load nearly always rose, or fell, from each row of a run to the next."""
    key = np.lexsort((readings.order, readings.run))
    follows = np.diff(readings.run[key]) == 0
    for values in (readings.row_slip, readings.row_load):
        steps = np.sign(np.diff(values[key])[follows])
        if steps.size and abs(float(steps.mean())) > MOST_ONE_WAY:
            return True
    return False


def _is_explained(readings: Readings, order: Floats) -> bool:
    """Whether polynomials of slip and log load nearly give the order (n,) of the rows."""
    slip, load = readings.row_slip, np.log(readings.row_load)
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    columns = np.stack([slip**i * load**j for i, j in powers], axis=1)
    left = project_out((order - order.mean())[:, None], columns)[:, 0]
    spread = float(np.sum((order - order.mean()) ** 2))
    return float(left @ left) <= (1.0 - MOST_EXPLAINED) * spread
