"""The radius of a wheel that a logged slip implies."""

from __future__ import annotations

import math

import numpy as np

from soilml.log_import.channels.inputs import Inputs, moving, our_slip
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.units import spelling

PLAUSIBLE = (0.02, 0.7)  # Radii of wheels, m
#: Slips from which a radius follows; fewest samples; scatter of the radius over it.
_SLIPS, _FEWEST, _SCATTER = (0.0, 0.9), 20, 0.05
COMPUTED = 0.002  # Largest scatter over the radius of a slip that was computed from both speeds


def radius_of_slip(inputs: Inputs, slip: Candidate, run: Run) -> tuple[float, float]:
    r"""Radius in m at which a logged slip is that of rotation and travel, and its scatter over it.

    .. math:: r = v / (\omega (1 - s))

    A slip that was computed from both has next to no scatter, one that was set has theirs. NaN
    where there is no such radius.
    """
    rotation, ground = inputs.values.get("wheel_speed"), inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return math.nan, math.nan
    own = on_grid(inputs.time, *run.find(slip.address))
    percent = spelling(slip.unit) == "percent" or slip.about.size > 1.5
    scale = 0.01 if percent else 1.0
    own = our_slip(scale * own, "1 - v/(r omega)")
    driven = moving(inputs) & (own > _SLIPS[0]) & (own < _SLIPS[1]) & (np.abs(rotation) > 0.0)
    if driven.sum() < _FEWEST:
        return math.nan, math.nan
    radii = np.abs(ground[driven] / rotation[driven]) / (1.0 - own[driven])
    radii = radii[np.isfinite(radii)]
    if radii.size < _FEWEST:
        return math.nan, math.nan
    middle = float(np.median(radii))
    spread = float(np.median(np.abs(radii - middle)))
    return (middle, spread / middle) if spread < _SCATTER * middle else (math.nan, math.nan)
