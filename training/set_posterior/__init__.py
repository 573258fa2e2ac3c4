"""The posterior of a set of readings of one soil, as one ONNX graph that runs onboard.

A wheel family (`RecipeFamily`, `DimensionlessFamily`) simulates wheels, `fit_response` fits their
response surface, `calibrate_misfit_limits` makes the graph with its misfit limits, and
`validate_posterior` measures its accuracy.
"""

from training.set_posterior.families.dimensionless_family import DimensionlessFamily
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.misfit_test import MisfitLimits
from training.set_posterior.response_surface import Response, ResponseSettings, fit_response
from training.set_posterior.validation import (
    SetFigures,
    calibrate_misfit_limits,
    validate_posterior,
)

__all__ = [
    "DimensionlessFamily",
    "MisfitLimits",
    "RecipeFamily",
    "Response",
    "ResponseSettings",
    "SetFigures",
    "SetPosteriorGraph",
    "SimulatedSets",
    "WheelFamily",
    "calibrate_misfit_limits",
    "fit_response",
    "validate_posterior",
]
