"""Tables of more rows than a fit takes: near replicates become one row of equal information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from heapq import heappop, heappush
from typing import Any

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.operating_points import gear_numbers, operating_points_of_rows
from soilml.fitting.predictions import forces, predict
from soilml.fitting.readings import CondensedRows, Readings
from soilml.identification.nonlinear import nonlinear
from soilml.physics.operating_point import COVARIATES, FROM_ORDER, Operating

MOST_ROWS, CELLS = 2_000, 1024  # Rows above which they are condensed, and rows that become of them
#: Rows of the fit that shows where the optimum is, and rounds in which it is approached.
FIRST_ROWS, ROUNDS = 1000, 2
BLOCK = 50_000  # Rows that are solved at a time
MOST_UNSOLVED = 200  # Most rows without equilibrium at the optimum that stay as they are


def condensed(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Readings:
    r"""The readings, with rows that were driven nearly alike as one row where there are many.

    .. math::
        y_c = f(x_c; \theta_0) + \frac{\sum_i w_i [y_i - f(x_i; \theta_0)]}{\sum_i w_i}, \quad
        w_i = \sigma_i^{-2}, \quad \sigma_c = \left(\sum_i w_i\right)^{-1/2}

    for the rows i of a cell c, whose operating points :math:`x_i` have the mean :math:`x_c`. What
    differs within a cell is subtracted as the model has it at :math:`\theta_0`, so that the
    condensed readings change with the parameters as the mean of all does: at :math:`\theta_0`
    exactly, and beside it to second order in the width of the cells. Therefore
    :math:`\theta_0` is a fit, of a part of the rows first, and then of the condensed ones.

    Noise of slip and load becomes part of the noise of the readings. The squared distances within
    the cells are kept for the misfit. Rows without equilibrium at :math:`\theta_0`, of which there
    are few where the model holds, stay as they are. What follows from the order of the rows is kept
    where an effect of the case uses it: else cells would be wider in slip and load.

    case, free: The model, and its free parameters.
    readings: Rows (n,); they are returned where there are no more than `MOST_ROWS`.

    Raises `FitError` as `nonlinear` does.
    """
    count = len(readings.row_slip)
    if count <= MOST_ROWS:
        return readings
    models = (case.model, *case.gears.values())
    used = {field for model in models for effect in model.effects for field in effect.about.uses}
    unknown: dict[str, Any] = dict.fromkeys(FROM_ORDER.keys() - used)
    readings = replace(readings, at=replace(readings.at, **unknown))
    part = np.random.default_rng(0).permutation(count)[:FIRST_ROWS]
    fewer = readings.of_rows(np.sort(part))[1]
    cell: Integers | None = None
    for _ in range(ROUNDS):
        # near the optimum is enough: errors that rows share, which cost time, are left out
        fit = nonlinear(case, replace(fewer, shared_errors={}), free)
        known = case.with_values(dict(zip(fit.names, map(float, fit.values), strict=True)))
        residual, std = _residuals(known, readings)
        if cell is None:
            cell = cells_of(_coordinates(readings, std), _groups(readings.at), CELLS)
        fewer = _condensed_at(known, readings, residual, std, cell)
    return fewer


def _condensed_at(
    known: Case, readings: Readings, residual: Floats, std: Floats, cell: Integers
) -> Readings:
    """The condensed rows of cells (n,), with the differences that a known case has within them."""
    n, has = len(readings.row_slip), np.isfinite(residual)
    solved = np.isin(np.arange(n), readings.row[has])
    unsolved = np.setdiff1d(readings.row, readings.row[has])
    kept = unsolved[:: len(unsolved) // MOST_UNSOLVED + 1]
    number = np.full(n, -1)
    number[solved] = np.unique(cell[solved], return_inverse=True)[1]
    cells, names = int(number.max()) + 1, ("slip", "load", "gear", *COVARIATES)
    first = np.unique(number[solved], return_index=True)[1]
    size = np.bincount(number[solved], minlength=cells)
    columns: dict[str, Any] = {}
    for name in names:
        if np.ndim(value := getattr(readings.at, name)):
            own = np.asarray(value)[solved]
            mean = own[first] if name == "gear" else np.bincount(number[solved], own) / size
            columns[name] = np.append(mean, np.asarray(value)[kept])
    at = replace(readings.at, **columns)
    middle = forces(known, operating_points_of_rows(at, np.arange(cells)))
    position = np.full(n, -1)
    position[kept] = cells + np.arange(len(kept))
    parts: list[tuple[Integers, Integers, Floats, Floats]] = []
    squares, counted = 0.0, 0
    for i, name in enumerate(readings.channels):
        own = np.flatnonzero(has & (readings.channel == i))
        where, weight = number[readings.row[own]], std[own] ** -2.0
        total = np.bincount(where, weight, cells)
        with np.errstate(divide="ignore", invalid="ignore"):  # cells without a reading
            mean = np.bincount(where, weight * residual[own], cells) / total
            narrow = total**-0.5
        squares += float(weight @ (residual[own] - mean[where]) ** 2)
        left = np.flatnonzero((position[readings.row] >= 0) & (readings.channel == i))
        counted += own.size + left.size
        full = np.flatnonzero(total > 0.0)
        measured = np.append((getattr(middle, name) + mean)[full], readings.measured[left])
        row = np.append(full, position[readings.row[left]])
        parts.append((row, np.full(row.size, i), measured, np.append(narrow[full], std[left])))
    rows, channel, measured, own_std = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = cells + len(kept)
    return replace(
        readings,
        at=at,
        run=np.zeros(count, np.int64),
        runs=readings.runs[:1],
        order=np.arange(count),
        row=rows,
        channel=channel,
        measured=measured,
        std=own_std,
        from_case=np.zeros(len(rows), bool),
        slip_std=np.zeros(count),
        load_std=np.zeros(count),
        condensed=CondensedRows(n, counted, squares, readings.undeclared),
    )


def _residuals(known: Case, readings: Readings) -> tuple[Floats, Floats]:
    """Residuals (m,) at a known case, NaN where none, and standard deviations.

    Noise that is not declared is that of the residuals.
    """
    residual, std = np.full(len(readings), np.nan), np.full(len(readings), np.nan)
    count = len(readings.row_slip)
    for start in range(0, count, BLOCK):
        selected, part = readings.of_rows(np.arange(start, min(start + BLOCK, count)))
        prediction = predict(known, [], np.zeros((1, 0)), part)[0]
        residual[selected] = part.measured - prediction
        std[selected] = np.hypot(part.noise_at(prediction), noise_of_operation(known, part))
    for i in range(len(readings.channels)):
        own = readings.channel == i
        estimated = max(float(np.sqrt(np.nanmean(residual[own] ** 2))), 1e-15)
        std[own & ~np.isfinite(std)] = estimated
    return residual, std


def _coordinates(readings: Readings, std: Floats) -> Floats:
    """Coordinates (n, d) by which rows are alike.

    Slip, log load and speeds over their spreads, and the logarithm of the noise: near a reading of
    zero a relative noise, and with it the weight of a row, changes much with little of the slip.
    """
    at = readings.at
    columns = [readings.row_slip, np.log(np.abs(readings.row_load))]
    columns += [np.asarray(v) for name in COVARIATES if np.ndim(v := getattr(at, name))]
    columns = [c / spread for c in columns if (spread := c.std()) > 0.0]
    for i in range(len(readings.channels)):
        own = readings.channel == i
        log_std = np.full(len(readings.row_slip), np.nan)
        log_std[readings.row[own]] = np.log(std[own])
        columns.append(np.where(np.isfinite(log_std), log_std, np.nanmean(log_std)))
    return np.stack(columns, axis=1)


def _groups(at: Operating) -> Integers:
    """Rows (n,) that are never one: of two gears, of two passes, driving and braking."""
    slip = np.asarray(at.slip)
    number = np.zeros(slip.shape) if at.pass_number is None else np.asarray(at.pass_number)
    passes = np.unique(np.broadcast_to(number, slip.shape), return_inverse=True)[1]
    return np.asarray((gear_numbers(at) * (passes.max() + 1) + passes) * 2 + (slip < 0.0))


def cells_of(points: Floats, groups: Integers, most: int) -> Integers:
    """Number of the cell of each of n rows, (n,).

    The cell whose points scatter most, all together, is divided at the mean of the coordinate in
    which they do, until there are `most` cells or the points of each are equal.

    points: Coordinates (n, d), scaled so that their distances compare.
    groups: Rows of different groups (n,) share no cell.
    most: Number of cells, of which there are no more unless there are more groups.
    """
    waiting: list[tuple[float, int, int, Integers]] = []
    done: list[Integers] = []

    def put(rows: Integers) -> None:
        own = points[rows]
        sums = ((own - own.mean(axis=0)) ** 2).sum(axis=0)
        widest = int(np.argmax(sums))
        if sums[widest] > 0.0:
            heappush(waiting, (-float(sums[widest]), int(rows[0]), widest, rows))
        else:
            done.append(rows)

    for group in np.unique(groups):
        put(np.flatnonzero(groups == group))
    while waiting and len(waiting) + len(done) < most:
        _, _, widest, rows = heappop(waiting)
        values = points[rows, widest]
        low = values <= values.mean()
        if low.all() or not low.any():  # equal but for rounding
            done.append(rows)
            continue
        put(rows[low])
        put(rows[~low])
    cell = np.zeros(len(points), np.int64)
    for number, rows in enumerate([*done, *(entry[3] for entry in waiting)]):
        cell[rows] = number
    return cell
