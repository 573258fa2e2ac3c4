"""Draws of the model's error in drawbar pull at slips and loads that are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.model_discrepancy import range_with_zero
from soilml.fitting.operating_points import operating_points
from soilml.fitting.readings import declared_std
from soilml.io.table import Table
from soilml.numerics.smooth_process import process_columns, slip_load_points
from soilml.quantities import column
from soilml.traction.soil_draws import SoilDraws

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PullDiscrepancy:
    """Errors of the predicted pull, N: one for each draw of the soil, load and slip.

    Attributes
    ----------
    amplitude
        Standard deviation before any reading, N.
    posterior, prior
        Draws (n, loads, m) of the error, given the measured pulls and before them.
    """

    amplitude: float
    posterior: Floats
    prior: Floats


def draw_pull_discrepancy(
    case: Case,
    table: Table,
    draws: SoilDraws,
    loads: Sequence[float],
    slip: Floats,
    *,
    noise_scale: float | None = 1.0,
    seed: int = 0,
) -> PullDiscrepancy | None:
    r"""Draws of the error under the loads (N) at the slips (m,); None where none is declared.

    The error is C w with the columns C of the process and standard normal weights w. Given the soil
    of a draw, the k measured pulls leave residuals r with noise D, and the weights are normal with

    .. math:: E[w] = M^{-1} B^T D^{-1} r, \quad \operatorname{cov}[w] = M^{-1}, \quad
        M = I + B^T B, \quad B = D^{-1} C

    Parameters
    ----------
    case
        Model, noise and discrepancy.
    table
        Rows with status ok. A share of the range is that of their pulls, or, where no pull was
        measured, of the median prediction for these rows.
    draws
        Draws of the soil, given the same rows.
    noise_scale
        Factor on noise and discrepancy; None to leave the measured pulls out.

    References
    ----------
    Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.7 and 2.8.
    """
    key = column("drawbar_pull")
    own = case.discrepancy.get(key)
    if own is None:
        return None
    predicted = _predicted_pull(case, draws, table)
    reading = std = np.full(len(table), np.nan)
    if key in table:
        reading, std = table[key], declared_std(case, table, key)
    typical = reading if np.isfinite(reading).any() else np.median(predicted, axis=0)
    amplitude = own.amplitude(range_with_zero(typical))
    scale = 1.0 if noise_scale is None else noise_scale
    asked_load, asked_slip = (g.ravel() for g in np.meshgrid(loads, slip, indexing="ij"))
    points = slip_load_points(
        np.append(table["slip"], asked_slip),
        np.append(table["load_N"], asked_load),
        own.slip_length,
        own.log_load_length,
    )
    at_rows, at_asked = np.split(process_columns(points, scale * amplitude), [len(table)])
    used = np.isfinite(reading) & (std > 0.0) & (noise_scale is not None)
    rng = np.random.default_rng(seed)
    shape = (len(predicted), at_rows.shape[1])
    before = rng.standard_normal(shape)
    residual = np.nan_to_num(reading - predicted)[:, used] / (scale * std[used])
    basis = at_rows[used] / (scale * std[used, None])
    precision = np.eye(shape[1]) + basis.T @ basis
    mean = np.linalg.solve(precision, basis.T @ residual.T).T
    # with M = L L^T, the weights L^-T z have the covariance M^-1
    spread = np.linalg.solve(np.linalg.cholesky(precision).T, rng.standard_normal(shape).T).T
    grid = (len(predicted), len(loads), len(slip))
    after = ((mean + spread) @ at_asked.T).reshape(grid)
    return PullDiscrepancy(amplitude, after, (before @ at_asked.T).reshape(grid))


def _predicted_pull(case: Case, draws: SoilDraws, table: Table) -> Floats:
    """Pull of each draw at the rows, N (n, k); NaN where the soil does not carry the load."""
    soils = draws.of(case, np.arange(len(draws.values))[:, None])
    pull = soils.model(soils.soil, operating_points(table)).drawbar_pull
    return np.broadcast_to(np.asarray(pull), (len(draws.values), len(table)))
