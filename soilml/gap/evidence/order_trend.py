"""Trends of residuals with the order of the runs, and with that of the rows of a run."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.readings import Readings
from soilml.gap.evidence.family_wise import family_wise_p, scores
from soilml.gap.report.results import SoilTrend
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns
from soilml.inference.posterior import Posterior
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
    ("friction angle", SCATTER_UNITS["friction_angle"]),
    ("bearing strength", SCATTER_UNITS["bearing"]),
)


def order_trends(posterior: Posterior, seed: int) -> list[SoilTrend]:
    r"""Tests of a soil that changes evenly along the order of runs, or of a run's rows.

    .. math:: g_k(o) = P W (J_k o), \quad z = g_k(o) \cdot W r / |g_k(o)|

    with J_k the change of the readings with friction angle or bearing strength, o the centred
    order, W the whitening by noise, scatter from run to run and a smooth discrepancy beside the
    soil alone, and P the projection off the soil. Along the runs, the p value is that of the
    largest score among all orders of the runs, which needs no knowledge of the scatter; along the
    rows of a run, scores are compared with those of noise. Both are family-wise, over parameters
    and orders.

    Empty where the order is that of slip or load, or runs are few.

    References: Edgington and Onghena, Randomization Tests, 2007, section 3.4; Rao, Proc. Cambridge
    Phil. Soc. 44, 1948 (score test).
    """
    readings, soil = posterior.terms.readings, posterior.soil
    among_runs, within = _orders(readings)
    tests = (among_runs is not None) + (within is not None)
    if not tests:
        return []
    columns = scatter_columns(soil.fit.fitted(), readings)
    whiten = posterior.terms.whiten(soil.beside.at, soil.outliers)
    residual = np.asarray(whiten @ soil.linear.residual)
    explained = np.asarray(whiten @ soil.fit.derivatives)
    found = []
    if among_runs is not None:
        own = readings.run[readings.row][:, None] == np.arange(len(readings.runs))
        by_run = [
            project_out(np.asarray(whiten @ (columns[:, k : k + 1] * own)), explained)
            for k in range(len(PARAMETERS))
        ]
        found += _along_runs(by_run, residual, among_runs, tests, seed)
    if within is not None:
        trend = np.asarray(whiten @ (columns * within[readings.row][:, None]))
        z = scores(residual, trend, explained)
        own_trend = project_out(trend, explained)
        size = (own_trend.T @ residual) / np.maximum((own_trend**2).sum(axis=0), 1e-12)
        for k, score in enumerate(z):
            p = min(1.0, tests * family_wise_p(float(score), len(z)))
            found.append(_trend("rows", k, float(score), p, float(size[k])))
    return sorted(found, key=lambda one: one.p)


def _along_runs(
    by_run: list[Floats], residual: Floats, order: Floats, tests: int, seed: int
) -> list[SoilTrend]:
    """Trends with the order of the runs, (runs,); `by_run` are columns (m, runs) by parameter."""
    rng = np.random.default_rng(seed)
    orders = np.vstack([order, rng.permuted(np.tile(order, (PERMUTATIONS, 1)), axis=1)])
    products = np.stack([orders @ (b.T @ residual) for b in by_run], axis=1)
    squares = np.stack([((orders @ (b.T @ b)) * orders).sum(axis=1) for b in by_run], axis=1)
    squares = np.maximum(squares, 1e-12)
    z = products / np.sqrt(squares)
    largest = np.abs(z[1:]).max(axis=1)
    found = []
    for k in range(len(by_run)):
        at_least = float(np.sum(largest >= abs(z[0, k]) - 1e-9))
        p = min(1.0, tests * (at_least + 1.0) / (len(largest) + 1.0))
        found.append(_trend("runs", k, float(z[0, k]), p, float(products[0, k] / squares[0, k])))
    return found


def _trend(order: str, k: int, z: float, p: float, units: float) -> SoilTrend:
    name, unit = PARAMETERS[k]
    return SoilTrend(order, name, z, p, units * unit)


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
