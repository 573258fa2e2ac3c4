"""What follows from the order in which rows were driven: how far a campaign is, where loads go."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.levels import is_one_load
from soilml.io.table import Table
from soilml.physics.operating_point import FROM_ORDER

#: A load has risen or fallen where it differs by more than this fraction from the last extreme:
#: loads of one level differ by less (`soilml.fitting.levels.LOG_LOAD_RULE`).
TURNING = 0.12
#: Share of the variance of the progress that slip and load may explain, by polynomials of this
#: degree: above it the rows were sorted, or driven in that order, and nothing tells the two apart.
MOST_EXPLAINED, DEGREE = 0.95, 2


def with_order_columns(case: Case, table: Table, fields: Collection[str] | None = None) -> Table:
    """The table with the columns of `FROM_ORDER` that it lacks.

    Those of `fields`; None: those that effects of the case use. Rows have an order if they were
    timed, or if those of each run stand together: a table in which runs alternate was sorted by
    something else. There is no progress where slip and load follow from the order of the rows and
    no times are known, and none between two runs, which may differ for any reason. A load has no
    direction where all loads are of one level.
    """
    if fields is None:
        models = (case.model, *case.gears.values())
        fields = {field for m in models for e in m.effects for field in e.about.uses}
    wanted = [f for f in FROM_ORDER if f in fields and FROM_ORDER[f] not in table]
    if not wanted or len(table) < 2:
        return table
    progress = campaign_progress(table)
    columns = {}
    runs = np.unique(table["run"]).size if "run" in table else 1
    timed = _has_times(table)
    changes = int(np.count_nonzero(table["run"][1:] != table["run"][:-1])) if "run" in table else 0
    if not (timed or changes == runs - 1):  # the rows of each run stand together
        return table
    if (
        "progress" in wanted
        and runs != 2
        and (timed or share_by_driving(progress, table["slip"], table["load_N"]) <= MOST_EXPLAINED)
    ):
        columns[FROM_ORDER["progress"]] = progress
    if "load_direction" in wanted and not is_one_load(table["load_N"]):
        order = np.argsort(progress, kind="stable")
        direction = np.empty(len(table))
        direction[order] = load_directions(table["load_N"][order])
        columns[FROM_ORDER["load_direction"]] = direction
    return replace(table, columns=dict(table.columns) | columns) if columns else table


def campaign_progress(table: Table) -> Floats:
    """Progress of a campaign at each row, (n,): 0 at the first, 1 at the last.

    By time where `time_s` is given and does not start anew with each run, else by the order of the
    rows.
    """
    time = np.arange(len(table), dtype=np.float64)
    if _has_times(table):
        time = table["time_s"]
    span = float(np.ptp(time))
    return (time - time.min()) / span if span > 0.0 else np.zeros(len(table))


def _has_times(table: Table) -> bool:
    """Whether the table has times of one clock: those of different runs do not overlap."""
    if "time_s" not in table or not np.isfinite(table["time_s"]).all():
        return False
    time = table["time_s"]
    run = table["run"] if "run" in table else np.zeros(len(time))
    spans = sorted((time[run == r].min(), time[run == r].max()) for r in np.unique(run))
    apart = all(end <= start for (_, end), (start, _) in pairwise(spans))
    return apart and float(np.ptp(time)) > 0.0


def share_by_driving(order: Floats, slip: Floats, load: Floats) -> float:
    """Share of the variance of an order (n,) of rows that polynomials of slip and log load have.

    One where there are too few rows to tell.
    """
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    columns = np.stack([slip**i * np.log(load) ** j for i, j in powers], axis=1)
    fit, _, rank, _ = np.linalg.lstsq(columns, order, rcond=None)
    variance = float(np.var(order))
    if len(order) <= 2 * rank or variance == 0.0:
        return 1.0
    return 1.0 - float(np.var(order - columns @ fit)) / variance


def load_directions(load: Floats) -> Floats:
    """1 where the load (n,), in the order of the rows, last rose, -1 where it last fell.

    The first load rose from none.
    """
    direction, extreme = 1.0, float(load[0])
    found = np.empty(len(load))
    for i, value in enumerate(load.tolist()):
        if direction * (value - extreme) >= 0.0:
            extreme = value
        elif abs(value - extreme) > TURNING * extreme:
            direction, extreme = -direction, value
        found[i] = direction
    return found
