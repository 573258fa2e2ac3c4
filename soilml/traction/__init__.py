"""How hard a running gear pulls and what slope it climbs, on soil known as well as rows tell."""

from __future__ import annotations

from soilml.traction.draws import Draws, posterior_draws, prior_draws
from soilml.traction.estimated import estimated_draws
from soilml.traction.prediction import Band, Traction, band, traction
from soilml.traction.prospect import Prospect, prospects

__all__ = [
    "Band",
    "Draws",
    "Prospect",
    "Traction",
    "band",
    "estimated_draws",
    "posterior_draws",
    "prior_draws",
    "prospects",
    "traction",
]
