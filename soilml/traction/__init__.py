"""Traction: drawbar pull and climbable slope, with the uncertainty of the soil parameters."""

from __future__ import annotations

from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.traction.draws import SoilDraws
from soilml.traction.prediction import TractionPrediction
from soilml.traction.report import PullReport
from soilml.traction.soil_draws import prior_draws
from soilml.traction.vehicle import DrivenVehicle, Performance, performance
from soilml.traction.workflow import pull_report

#: The name under which `soilml` has it
pull = pull_report

__all__ = [
    "DrivenVehicle",
    "Performance",
    "PullReport",
    "QuantileBand",
    "SoilDraws",
    "TractionPrediction",
    "performance",
    "prior_draws",
    "pull",
    "pull_report",
    "quantile_band",
]
