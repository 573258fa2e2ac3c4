"""What is known of pull and slope under some loads, beside what was known before the rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.numerics.quantile_band import QuantileBand, quantile_band
from soilml.physics.operating_point import Operating
from soilml.row_status import Status
from soilml.traction.messages import DrivenRange, warnings
from soilml.traction.pull_and_slope import Traction, traction
from soilml.traction.soil_draws import SoilDraws

Floats = NDArray[np.float64]

#: Loads of rows that differ by less than this share are one.
SAME_LOAD = 0.1
#: Loads that are shown where rows have more: the lightest, those between, the heaviest.
MOST_LOADS = 3
#: The highest slip where none is asked for and none higher was driven; slips of a curve.
HIGHEST, SLIPS = 0.6, 12


@dataclass(frozen=True)
class LoadPrediction:
    """Pull and slope under one load: as rows tell, as the prior alone would, and what to doubt."""

    known: Traction
    prior: Traction
    warnings: tuple[str, ...]

    @property
    def left(self) -> tuple[float, float]:
        """Width of the bands of largest pull and steepest slope over those of the prior."""
        known, prior = self.known, self.prior
        pull = _share(quantile_band(known.largest_pull), quantile_band(prior.largest_pull))
        return pull, _share(quantile_band(known.steepest), quantile_band(prior.steepest))


def predictions_by_load(
    case: Case,
    draws: SoilDraws,
    prior: SoilDraws,
    loads: Sequence[float],
    slip: Floats,
    driven: DrivenRange,
    given: Mapping[str, float] | None = None,
) -> list[LoadPrediction]:
    """Pull and slope under each load (N) at the slips (m,), by draws and by the prior's.

    Raises `InputError` for a load that half the soils do not carry at any sinkage.
    """
    found = []
    for load in loads:
        _check_carried(case, draws, load, slip, given)
        known, before = (traction(case, d, load, slip, given) for d in (draws, prior))
        bare = LoadPrediction(known, before, ())
        found.append(LoadPrediction(known, before, tuple(warnings(known, bare.left, driven))))
    return found


def driven_loads(load: Floats) -> list[float]:
    """The loads (N) of rows, those alike as their mean, at most three of them."""
    ordered = np.sort(load)
    parts = np.split(ordered, 1 + np.flatnonzero(np.diff(ordered) > SAME_LOAD * ordered[1:]))
    means = [float(part.mean()) for part in parts]
    places = np.linspace(0, len(means) - 1, min(len(means), MOST_LOADS)).round().astype(int)
    return [means[i] for i in places]


def asked_slips(limit: float | None, driven: DrivenRange) -> Floats:
    """Slips (m,) up to a limit, or to 0.6 and to the highest that was driven.

    Raises `InputError` for a limit that is not between 0 and 1.
    """
    if limit is not None and not 0.0 < limit < 1.0:
        raise InputError(f"slip limit {limit:g}; needed is a slip between 0 and 1")
    top = max(HIGHEST, driven.slip[1]) if limit is None else limit
    return np.asarray(top * np.arange(1, SLIPS + 1) / SLIPS)


def _share(known: QuantileBand, prior: QuantileBand) -> float:
    """Width over the prior's; NaN where the prior has none."""
    return float(known.width / prior.width) if prior.width > 0.0 else np.nan


def _check_carried(
    case: Case, draws: SoilDraws, load: float, slip: Floats, given: Mapping[str, float] | None
) -> None:
    if not (np.isfinite(load) and load > 0.0):
        raise InputError(f"load {load:g} N; needed is a load above zero")
    soils = draws.of(case, np.arange(len(draws.values)))
    known = dict(given or {})
    force = soils.model(soils.soil, Operating(slip=float(slip[0]), load=load, **known))
    failed = np.asarray(force.status)[np.asarray(force.status) != 0]
    if failed.size > 0.5 * len(draws.values):
        worst = Status(int(np.bincount(failed).argmax()))
        heaviest = float(np.median(np.asarray(force.load)[np.asarray(force.status) == worst]))
        limit = f" (at most about {heaviest:.3g} N)" if worst is Status.TOO_HEAVY else ""
        raise InputError(f"load {load:g} N: {worst.reason}{limit}; ask for another, or check kphi")
