"""How hard a running gear pulls and what slope it climbs, on soil known as well as rows tell."""

from __future__ import annotations

from soilml.numerics.quantile_band import QuantileBand, quantile_band
from soilml.traction.by_load import LoadPrediction, predictions_by_load
from soilml.traction.moment_draws import estimated_draws
from soilml.traction.pull_and_slope import Traction, traction
from soilml.traction.soil_draws import SoilDraws, posterior_draws, prior_draws

__all__ = [
    "LoadPrediction",
    "QuantileBand",
    "SoilDraws",
    "Traction",
    "estimated_draws",
    "posterior_draws",
    "predictions_by_load",
    "prior_draws",
    "quantile_band",
    "traction",
]
