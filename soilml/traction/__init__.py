"""Traction: drawbar pull and climbable slope, with the uncertainty of the soil parameters."""

from __future__ import annotations

from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.traction.draws import SoilDraws
from soilml.traction.pull_and_slope import (
    LoadPrediction,
    Traction,
    predict_traction,
    predictions_by_load,
)
from soilml.traction.report import PullReport, pull_report
from soilml.traction.soil_draws import prior_draws

#: The name under which `soilml` has it
pull = pull_report

__all__ = [
    "LoadPrediction",
    "PullReport",
    "QuantileBand",
    "SoilDraws",
    "Traction",
    "predict_traction",
    "predictions_by_load",
    "prior_draws",
    "pull",
    "pull_report",
    "quantile_band",
]
