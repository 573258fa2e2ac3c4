"""Trends of residuals with the order of the runs, and with that of the rows of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.readings import Readings
from soilml.fitting.row_order import share_by_driving
from soilml.gap.results import SoilTrend
from soilml.gap.scores import family_wise_p, scores
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns
from soilml.inference.posterior import Posterior
from soilml.numerics.subspaces import project_out
from soilml.remarks import Remark

#: Family-wise level of the tests, and fewest runs whose order can show a trend: of five, one order
#: and its reverse are 1/60 of all.
TREND_LEVEL, FEWEST_RUNS = 0.02, 5
PERMUTATIONS = 4000  # Orders of the runs that are drawn
#: Share of the variance of an order that slip and load may explain: above it, rows were driven in
#: the order of slip or load, and nothing tells the two apart.
MOST_EXPLAINED = 0.9
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

    def add(order: str, k: int, z: float, p: float, units: float) -> None:
        name, unit = PARAMETERS[k]
        found.append(SoilTrend(order, name, float(z), min(1.0, tests * p), float(units * unit)))

    if among_runs is not None:
        own = readings.run[readings.row][:, None] == np.arange(len(readings.runs))
        rng = np.random.default_rng(seed)
        orders = rng.permuted(np.tile(among_runs, (PERMUTATIONS, 1)), axis=1)
        orders = np.vstack([among_runs, orders])
        by_run = [
            project_out(np.asarray(whiten @ (column[:, None] * own)), explained)
            for column in columns.T
        ]
        products = np.stack([orders @ (b.T @ residual) for b in by_run], axis=1)
        squares = np.stack([((orders @ (b.T @ b)) * orders).sum(axis=1) for b in by_run], axis=1)
        squares = np.maximum(squares, 1e-12)
        z = products / np.sqrt(squares)
        largest = np.abs(z[1:]).max(axis=1)
        for k in range(len(by_run)):
            at_least = float(np.sum(largest >= abs(z[0, k]) - 1e-9))
            p = (at_least + 1.0) / (PERMUTATIONS + 1.0)
            add("runs", k, z[0, k], p, products[0, k] / squares[0, k])
    if within is not None:
        trend = np.asarray(whiten @ (columns * within[readings.row][:, None]))
        z = scores(residual, trend, explained)
        own_trend = project_out(trend, explained)
        size = (own_trend.T @ residual) / np.maximum((own_trend**2).sum(axis=0), 1e-12)
        for k, score in enumerate(z):
            add("rows", k, score, family_wise_p(float(score), len(z)), size[k])
    return sorted(found, key=lambda one: one.p)


def trend_remarks(trends: Sequence[SoilTrend]) -> list[Remark]:
    """That the soil may have changed, where residuals have a trend with the order."""
    where = {"runs": "from run to run", "rows": "along the rows of a run"}
    found: dict[str, Remark] = {}
    for trend in trends:
        if trend.p < TREND_LEVEL:
            text = f"the residuals drift {where[trend.order]}: the soil may have changed"
            remark = Remark(f"drift-of-{trend.order}", text, (trend.parameter,))
            found.setdefault(trend.order, remark)
    return list(found.values())


def _orders(readings: Readings) -> tuple[Floats | None, Floats | None]:
    """Order of the runs (runs,), and of the rows in their runs (n,), from -1/2 to 1/2.

    By progress where it is known, else as the rows are listed; None for an order that slip and load
    explain, and for that of few runs.
    """
    progress, run = readings.at.progress, readings.run
    time = np.arange(len(run)) if progress is None else np.asarray(progress)
    count = np.bincount(run)
    starts = np.bincount(run, time) / count
    among_runs = np.argsort(np.argsort(starts, kind="stable")) / max(len(starts) - 1, 1) - 0.5
    within = readings.order / np.maximum(count - 1, 1)[run] - 0.5

    def explained(order: Floats) -> bool:
        share = share_by_driving(order, readings.row_slip, readings.row_load)
        return share >= MOST_EXPLAINED

    key = np.lexsort((readings.order, run))
    follows = np.diff(run[key]) == 0
    steps = [np.sign(np.diff(v[key])[follows]) for v in (readings.row_slip, readings.row_load)]
    swept = any(own.size and abs(float(own.mean())) > MOST_ONE_WAY for own in steps)
    known = len(starts) >= FEWEST_RUNS and not explained(among_runs[run])
    return among_runs if known else None, None if swept or explained(within) else within
