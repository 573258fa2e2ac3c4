"""Plate and shear tests reduced to what they determine best, as tests of a model file's soil."""

from __future__ import annotations

import math

import numpy as np

from soilml.config.case import Case
from soilml.identification.bevameter.estimate import SpreadEstimate
from soilml.identification.bevameter.pressure_sinkage import LEAST_SIZE_RATIO, PressureSinkageFit
from soilml.identification.bevameter.shear_strength import ShearFit
from soilml.identification.bevameter.soil_section import widths_of_gears
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength
from soilml.report.numbers import significant

#: Standard deviations that the range of 95 % of a normal distribution reaches from its middle.
Z_95 = 1.96
#: Least scatter that is stated: no two places are more alike.
LEAST_SCATTER = 0.02


def pressure_test(fit: PressureSinkageFit, case: Case | None) -> PlatePressure | None:
    """The pressure at the reference depth, under the width of the gears or that of the plates.

    At this depth the errors of pressure and exponent are least correlated, so that the pressure and
    the range of n together say what the tests say of kc, kphi and n. None where plates of one size
    tell little of a gear of another width.
    """
    widths = widths_of_gears(case)
    if fit.several_sizes:
        width = widths[0] if len(widths) == 1 else 1.0 / float(np.mean(1.0 / np.array(fit.sizes)))
    else:
        width = fit.sizes[0]
        if any(max(w / width, width / w) > LEAST_SIZE_RATIO for w in widths):
            return None
    pressure = fit.pressure_at_depth(width)
    scatter = _scatter(pressure)
    if scatter is None:
        return None
    return PlatePressure(
        plate_width=significant(width),
        sinkage=significant(fit.depth),
        pressure=significant(pressure.value),
        scatter=scatter,
    )


def strength_test(fit: ShearFit) -> ShearStrength | None:
    """The strength under the mean normal stress, where cohesion and friction trade off least."""
    scatter = _scatter(fit.strength)
    if scatter is None:
        return None
    stress = float(np.mean([test.normal_stress for test in fit.tests]))
    return ShearStrength(
        normal_stress=significant(stress),
        strength=significant(fit.strength.value),
        scatter=scatter,
    )


def _scatter(estimate: SpreadEstimate) -> float | None:
    """Standard deviation of the logarithm at another place; None where it may be zero or less."""
    low, high = estimate.place_range
    if not 0.0 < low < estimate.value < high:
        return None
    return significant(max(math.log(high / low) / (2.0 * Z_95), LEAST_SCATTER), 2)
