"""Pull and slope under several loads, from the posterior and from the prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.numerics.quantiles import quantile_band
from soilml.physics.operating_point import Operating
from soilml.remarks import Remark
from soilml.row_status import Status
from soilml.traction.messages import MeasuredRange, prediction_warnings
from soilml.traction.pull_and_slope import Traction, predict_traction
from soilml.traction.pull_discrepancy import PullDiscrepancy
from soilml.traction.soil_draws import SoilDraws

Floats = NDArray[np.float64]

#: Relative difference up to which loads of rows count as equal: noise of a nominal load.
SAME_LOAD = 0.1
#: Number of loads predicted by default: the lightest, one between, the heaviest.
MOST_LOADS = 3
#: Default highest slip where no row has a higher one, and number of slips of a curve.
DEFAULT_SLIP_LIMIT, SLIPS = 0.6, 12


@dataclass(frozen=True)
class LoadPrediction:
    """Pull and slope under one load, from the posterior and from the prior, with warnings."""

    posterior: Traction
    prior: Traction
    warnings: tuple[Remark, ...]

    @property
    def remaining_fraction(self) -> tuple[float, float]:
        """Widths of the bands of largest pull and steepest slope over those of the prior."""
        posterior, prior = self.posterior, self.prior
        return (
            _width_ratio(posterior.largest_pull, prior.largest_pull),
            _width_ratio(posterior.steepest_slope, prior.steepest_slope),
        )


def predictions_by_load(
    case: Case,
    draws: SoilDraws,
    prior: SoilDraws,
    loads: Sequence[float],
    slip: Floats,
    measured: MeasuredRange,
    covariates: Mapping[str, float] | None = None,
    discrepancy: PullDiscrepancy | None = None,
) -> list[LoadPrediction]:
    """Pull and slope under each load (N) at the slips (m,), by draws and by draws of the prior.

    `discrepancy` holds draws of the error of the pull at the same loads and slips. Raises
    `InputError` for a load that more than half of the draws do not carry at any sinkage.
    """
    predictions = []
    for i, load in enumerate(loads):
        _check_carried(case, draws, load, slip, covariates)
        errors: tuple[Floats | None, Floats | None] = (None, None)
        if discrepancy is not None:
            errors = discrepancy.posterior[:, i], discrepancy.prior[:, i]
        after, before = (
            predict_traction(case, d, load, slip, covariates, error)
            for d, error in zip((draws, prior), errors, strict=True)
        )
        bare = LoadPrediction(after, before, ())
        texts = prediction_warnings(
            after, bare.remaining_fraction, measured, error_included=discrepancy is not None
        )
        predictions.append(LoadPrediction(after, before, tuple(texts)))
    return predictions


def measured_loads(load: Floats) -> list[float]:
    """The loads (N) of rows, groups of equal ones as their mean, at most `MOST_LOADS`."""
    ordered = np.sort(load)
    groups = np.split(ordered, 1 + np.flatnonzero(np.diff(ordered) > SAME_LOAD * ordered[1:]))
    means = [float(group.mean()) for group in groups]
    index = np.linspace(0, len(means) - 1, min(len(means), MOST_LOADS)).round().astype(int)
    return [means[i] for i in index]


def slip_grid(limit: float | None, measured: MeasuredRange) -> Floats:
    """Slips (m,) up to a limit; by default to the highest measured slip, at least to 0.6.

    Raises `InputError` for a limit that is not between 0 and 1.
    """
    if limit is not None and not 0.0 < limit < 1.0:
        raise InputError(f"slip limit {limit:g}; needed is a slip between 0 and 1")
    top = max(DEFAULT_SLIP_LIMIT, measured.slip[1]) if limit is None else limit
    return np.asarray(top * np.arange(1, SLIPS + 1) / SLIPS)


def _width_ratio(posterior: Floats, prior: Floats) -> float:
    """Width of the band of draws over that of the prior's; NaN where that has none."""
    width, prior_width = quantile_band(posterior).width, quantile_band(prior).width
    return float(width / prior_width) if prior_width > 0.0 else np.nan


def _check_carried(
    case: Case, draws: SoilDraws, load: float, slip: Floats, covariates: Mapping[str, float] | None
) -> None:
    if not (np.isfinite(load) and load > 0.0):
        raise InputError(f"load {load:g} N; needed is a load above zero")
    soils = draws.of(case, np.arange(len(draws.values)))
    at = Operating(slip=float(slip[0]), load=load, **dict(covariates or {}))
    force = soils.model(soils.soil, at)
    failed = np.asarray(force.status)[np.asarray(force.status) != 0]
    if failed.size > 0.5 * len(draws.values):
        worst = Status(int(np.bincount(failed).argmax()))
        heaviest = float(np.median(np.asarray(force.load)[np.asarray(force.status) == worst]))
        limit = f" (at most about {heaviest:.3g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(f"load {load:g} N: {worst.reason}{limit}; give another, or check kphi")
