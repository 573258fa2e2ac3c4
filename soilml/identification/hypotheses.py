"""Explanations of rows: errors of some size, a smooth discrepancy, an effect; fits of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from graphlib import CycleError

import numpy as np

from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import FitError, InputError
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.misfit import WeightedRows
from soilml.fitting.readings import Readings
from soilml.fitting.scipy_descents import descend
from soilml.fitting.shared_errors import declared_errors, usual_errors
from soilml.identification.soil_density import SoilDensity
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects.base import Effect
from soilml.quantities import CHANNELS, column

#: Amplitude of a typical smooth discrepancy of a channel, as a share of the range of its readings.
SMOOTH = 0.02
#: Relative tolerance of the descents: optima are points about which is linearised.
TOLERANCE = 1e-5
#: Rounds in which noise and errors in proportion to predictions follow these.
ROUNDS = 2
#: Standard deviations to which the size of an effect is looked for, and the share of its range that
#: it starts at: away from zero, where the derivative of some effects vanishes.
REACH, START = 4.0, 0.5


@dataclass(frozen=True)
class ErrorHypothesis:
    """A statement on how model and sensors differ from the model file.

    Attributes
    ----------
    prior
        Its probability before the rows are seen.
    scale
        Standard deviation of all errors, and amplitude of a smooth discrepancy, over the typical
        ones; 0 for those declared alone.
    effect
        Name of an effect of the catalogue that the model lacks; "" for none.
    size
        Standard deviation of its size about zero, in reference sizes.
    """

    prior: float
    scale: float = 0.0
    effect: str = ""
    size: float = 0.0

    def case_of(self, case: Case, effects: Mapping[str, type[Effect]]) -> Case:
        """The case with its effect and discrepancy."""
        if self.effect:
            case = with_effect(case, effects[self.effect])
        if not self.scale:
            return case
        smooth = {
            column(name): replace(
                case.discrepancy.get(column(name), Discrepancy()), share=self.scale * SMOOTH
            )
            for name in CHANNELS
        }
        return replace(case, discrepancy=smooth)

    def errors_of(
        self, case: Case, readings: Readings, free: Sequence[Coordinate]
    ) -> dict[str, float]:
        """Standard deviations of the errors that all rows share; declared ones are not scaled."""
        known = declared_errors(case)
        if not self.scale:
            return known
        usual = usual_errors(case, readings.row_load, [c.path for c in free])
        return {n: s if n in known else self.scale * s for n, s in usual.items()}

    def size_coordinate(self, effects: Mapping[str, type[Effect]]) -> list[Coordinate]:
        """The size of its effect, whose normal density ends where the effect is defined."""
        if not self.effect:
            return []
        about, size = effects[self.effect].about, effects[self.effect].about.size
        parameter = declared(effects[self.effect])[size]
        std = self.size * abs(about.reference[size])
        ends = max(parameter.lower, -REACH * std), min(parameter.upper, REACH * std)
        path = f"{self.effect}.{size}"
        return [Coordinate(path, parameter.unit, Prior(*ends), normal_std=std)]


def fit_hypothesis(
    hypothesis: ErrorHypothesis,
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    effects: Mapping[str, type[Effect]],
    start: Mapping[str, float],
) -> SoilDensity | None:
    """The density of the soil under a hypothesis, linearised in all else at the optimum.

    readings: Rows whose noise is known.
    start: Values of parameters, errors and size by path from which the descent starts.

    Returns None where the model has no equilibrium in some row, or refuses the effect.
    """
    try:
        changed = hypothesis.case_of(case, effects)
        errors = hypothesis.errors_of(case, readings, free)
        unknown = [*free, *hypothesis.size_coordinate(effects)]
        weighted = WeightedRows.of(changed, replace(readings, shared_errors=errors), unknown)
        x = np.asarray([_first(c, start) for c in weighted.unknown])
        optimum = descend(weighted.problem, x, tolerance=TOLERANCE)
        for _ in range(ROUNDS - 1):
            weighted = weighted.with_noise_at(optimum)
            optimum = descend(
                weighted.problem, optimum.x, tolerance=TOLERANCE, near=optimum.linearisation
            )
    except (InputError, FitError, CycleError):
        return None
    if not np.isfinite(optimum.prediction).all():
        return None
    return SoilDensity(optimum, weighted.columns, len(free))


def _first(coordinate: Coordinate, start: Mapping[str, float]) -> float:
    """Where the descent along a coordinate starts."""
    if coordinate.path in start:
        return coordinate.prior.fraction(start[coordinate.path])
    is_size = coordinate.normal_std is not None and coordinate.prior.lower >= 0.0
    return START / REACH if is_size else 0.5
