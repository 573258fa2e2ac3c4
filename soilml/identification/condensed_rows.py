"""Rows that were driven nearly alike as one row, whose readings tell as much of the soil."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.channel_predictions import (
    forces,
    noise_at_prediction,
    propagated_input_noise,
)
from soilml.fitting.free_parameters import FreeParameter
from soilml.fitting.observations import Channel, Condensed, Observations
from soilml.fitting.operating_points import gear_numbers, operating_points_of_rows
from soilml.identification.cells import cells_of
from soilml.identification.nonlinear import nonlinear
from soilml.physics.operating_point import COVARIATES, Operating

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Rows above which they are condensed, and rows that become of them.
MOST_ROWS, CELLS = 5_000, 1024
#: Rows of the fit that shows where the optimum is, and rounds in which it is approached.
FIRST_ROWS, ROUNDS = 1000, 2
#: Rows that are solved at a time.
BLOCK = 50_000
#: Most rows without equilibrium at the optimum that stay as they are.
MOST_UNSOLVED = 200


def condensed(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Observations:
    r"""The observations, with rows that were driven nearly alike as one row where there are many.

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
    are few where the model holds, stay as they are.

    Parameters
    ----------
    case, free
        The model, and its free parameters.
    data
        Rows (n,); they are returned where there are no more than `MOST_ROWS`.

    Raises
    ------
    FitError
        As `nonlinear` does.
    """
    count = len(data.slip)
    if count <= MOST_ROWS:
        return data
    part = np.random.default_rng(0).permutation(count)[:FIRST_ROWS]
    fewer = data.of_rows(np.sort(part))
    cell: Integers | None = None
    for _ in range(ROUNDS):
        # near the optimum is enough: errors that rows share, which cost time, are left out
        fit = nonlinear(case, replace(fewer, shared_errors={}), free)
        known = case.with_values(dict(zip(fit.names, map(float, fit.values), strict=True)))
        residuals = _residuals(known, data)
        if cell is None:
            cell = cells_of(_coordinates(data.at, residuals), _groups(data.at), CELLS)
        fewer = _condensed_at(known, data, residuals, cell)
    return fewer


@dataclass(frozen=True)
class _Residuals:
    """Readings minus predictions (n,) of a channel, and their standard deviations; NaN if none."""

    residual: Floats
    std: Floats


def _condensed_at(
    known: Case, data: Observations, residuals: Sequence[_Residuals], cell: Integers
) -> Observations:
    """The condensed rows of cells (n,), with the differences that a known case has within them."""
    solved = np.asarray(np.isfinite(np.stack([r.residual for r in residuals])).any(axis=0))
    measured = np.isfinite(np.stack([c.reading for c in data.channels])).any(axis=0)
    unsolved = np.flatnonzero(measured & ~solved)
    kept = unsolved[:: len(unsolved) // MOST_UNSOLVED + 1]
    rows, number = np.unique(cell[solved], return_inverse=True)
    cells = len(rows)
    first = np.zeros(cells, np.int64)
    first[number[::-1]] = np.flatnonzero(solved)[::-1]
    at = _joined(_means(data.at, solved, number, first), operating_points_of_rows(data.at, kept))
    middle = forces(known, operating_points_of_rows(at, np.arange(cells)))
    channels, squares, readings = [], 0.0, 0
    for channel, own in zip(data.channels, residuals, strict=True):
        residual, std = own.residual[solved], own.std[solved]
        known_here = np.isfinite(residual)
        weight = np.where(known_here, std**-2.0, 0.0)
        residual = np.where(known_here, residual, 0.0)
        total = np.bincount(number, weight, cells)
        with np.errstate(divide="ignore", invalid="ignore"):  # cells without a reading
            mean = np.bincount(number, weight * residual, cells) / total
            narrow = total**-0.5
        squares += float(weight @ (residual - np.nan_to_num(mean)[number]) ** 2)
        readings += int(known_here.sum()) + int(np.isfinite(channel.reading[kept]).sum())
        reading = np.append(getattr(middle, channel.name) + mean, channel.reading[kept])
        std = np.append(np.where(total > 0.0, narrow, np.nan), own.std[kept])
        channels.append(Channel(channel.name, reading, std, channel.declared))
    count = cells + len(kept)
    return replace(
        data,
        at=at,
        slip_std=np.zeros(count),
        load_std=np.zeros(count),
        channels=tuple(channels),
        condensed=Condensed(len(data.slip), readings, squares),
    )


def _residuals(known: Case, data: Observations) -> list[_Residuals]:
    """Of each channel, at a known case; noise that is not declared is that of the residuals."""
    found = [[np.full(len(data.slip), np.nan) for _ in range(2)] for _ in data.channels]
    for block in _blocks(len(data.slip)):
        part = data.of_rows(block)
        force = forces(known, part.at)
        inputs = propagated_input_noise(
            known, [], np.zeros(0), part.at, part.slip_std, part.load_std
        )
        for channel, (residual, std) in zip(part.channels, found, strict=True):
            prediction = getattr(force, channel.name)
            residual[block] = channel.reading - prediction
            alone = replace(part, channels=(channel,))
            own = np.isfinite(channel.reading)
            declared = noise_at_prediction(known, alone, prediction[None, own])[0]
            std[block[own]] = np.hypot(declared, inputs[channel.name][0, own])
    for channel, (residual, std) in zip(data.channels, found, strict=True):
        estimated = float(np.sqrt(np.nanmean(residual**2)))
        std[np.isfinite(channel.reading) & ~np.isfinite(std)] = max(estimated, 1e-15)
    return [_Residuals(residual, std) for residual, std in found]


def _blocks(count: int) -> Iterator[Integers]:
    for start in range(0, count, BLOCK):
        yield np.arange(start, min(start + BLOCK, count))


def _coordinates(at: Operating, residuals: Sequence[_Residuals]) -> Floats:
    """Coordinates (n, d) by which rows are alike.

    Slip, log load and speeds over their spreads, and the logarithm of the noise: near a reading of
    zero a relative noise, and with it the weight of a row, changes much with little of the slip.
    """
    columns = [np.asarray(at.slip), np.log(np.abs(np.asarray(at.load)))]
    columns += [np.asarray(v) for name in COVARIATES if np.ndim(v := getattr(at, name))]
    columns = [c / spread for c in columns if (spread := c.std()) > 0.0]
    for own in residuals:
        log_std = np.log(own.std)
        columns.append(np.where(np.isfinite(log_std), log_std, np.nanmean(log_std)))
    return np.stack(columns, axis=1)


def _groups(at: Operating) -> Integers:
    """Rows (n,) that are never one: of two gears, of two passes, driving and braking."""
    slip = np.asarray(at.slip)
    number = np.zeros(slip.shape) if at.pass_number is None else np.asarray(at.pass_number)
    passes = np.unique(np.broadcast_to(number, slip.shape), return_inverse=True)[1]
    return np.asarray((gear_numbers(at) * (passes.max() + 1) + passes) * 2 + (slip < 0.0))


def _means(
    at: Operating, solved: NDArray[np.bool_], number: Integers, first: Integers
) -> Operating:
    """Mean operating points (cells,) of the solved rows by the number of their cell."""
    count = np.bincount(number, minlength=len(first))
    means = {
        name: np.bincount(number, np.asarray(value)[solved], len(first)) / count
        for name in ("slip", "load", *COVARIATES)
        if np.ndim(value := getattr(at, name))
    }
    gear = None if at.gear is None else np.asarray(at.gear)[first]
    return replace(at, gear=gear, **means)


def _joined(at: Operating, more: Operating) -> Operating:
    """The operating points of both."""
    arrays = {
        name: np.append(value, getattr(more, name))
        for name in ("slip", "load", "gear", *COVARIATES)
        if np.ndim(value := getattr(at, name))
    }
    return replace(at, **arrays)
