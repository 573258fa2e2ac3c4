"""Signatures: the change of the readings by each effect of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import EffectCoordinate, size_coordinate
from soilml.fitting.levels import covariate_levels
from soilml.fitting.predictions import (
    PredictionRequest,
    linearise_many,
    predict_many,
)
from soilml.fitting.readings import Readings
from soilml.gap.data.candidate_effects import gears_differ, with_effect
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import COVARIATES

Floats = NDArray[np.float64]

#: Step of the secant that gives a signature, in reference sizes. A secant is used because some
#: effects start with a square root, whose derivative at zero is infinite.
SECANT_STEP = 0.5
#: A signature below this fraction of every reading's noise counts as zero.
MIN_CHANGE = 1e-6


@dataclass(frozen=True)
class Signature:
    """Change of every reading, (m,), per reference size of an effect."""

    name: str
    kind: str
    column: Floats
    #: 1 or -1 where the size can only change in that direction, 0 where it can in both
    sign: int


@dataclass(frozen=True)
class Untestable:
    """An effect that these runs cannot test, and the reason."""

    name: str
    reason: str


def current_size(case: Case, path: str, unit: float) -> float:
    """Coordinate of an effect's size in the case, in reference sizes; 0 where it is absent."""
    parameters = case.parameters()
    return float(parameters[path][1]) / unit if path in parameters else 0.0


def effect_signatures(
    case: Case, readings: Readings, effects: Mapping[str, type[Effect]]
) -> tuple[list[Signature], list[Untestable]]:
    """Signatures of all effects that these runs can test, and the effects that they cannot.

    An effect that the case has already is changed from its present size, which may be wrong.
    """
    (base,) = linearise_many([PredictionRequest(case, [], np.zeros((1, 0)), readings)])
    if isinstance(base, InputError):
        raise base
    sinkage = base.sinkage_at(np.zeros((1, 0)))
    requests = []
    reasons: dict[str, str] = {}
    changes: dict[str, tuple[EffectCoordinate, float, float]] = {}
    for name, effect in effects.items():
        if reason := _missing_covariate(case, effect, readings):
            reasons[name] = reason
            continue
        size = size_coordinate(effect, None)
        try:
            changed = with_effect(case, effect)
            at = current_size(changed, size.path, size.prior.upper)
            step = SECANT_STEP if size.upper >= at + SECANT_STEP else -SECANT_STEP
        except InputError as error:
            reasons[name] = str(error)
            continue
        changes[name] = size, at, step
        x = np.asarray([[at + step]])
        requests.append(PredictionRequest(changed, [size], x, readings, sinkage))
    signatures = []
    predictions = predict_many(requests)
    for (name, (size, at, step)), prediction in zip(changes.items(), predictions, strict=True):
        if isinstance(prediction, InputError):
            reasons[name] = str(prediction)
            continue
        column = (prediction[0] - base.prediction) / step
        if not np.isfinite(column).all():
            reasons[name] = "with it, the model has no equilibrium in some row"
        elif not np.any(np.abs(column) > MIN_CHANGE * readings.std):
            reasons[name] = "it changes no measured quantity"
        else:
            sign = 0 if size.lower < at < size.upper else int(np.sign(step))
            signatures.append(Signature(name, effects[name].about.kind, column, sign))
    return signatures, [Untestable(name, reasons[name]) for name in effects if name in reasons]


def _missing_covariate(case: Case, effect: type[Effect], readings: Readings) -> str:
    """What these runs lack to test an effect; empty where they have it."""
    if effect.about.varied and not gears_differ(case, effect.about.varied_dimension):
        return f"needs {effect.about.varied}"
    for field in effect.about.needs:
        value = getattr(readings.at, field)
        if value is None:
            return f"needs the column {COVARIATES[field]}"
        values = np.broadcast_to(value, readings.run.shape)
        if covariate_levels(field, values, readings.run).count < 2:
            return f"needs runs at several values of {COVARIATES[field]}"
    return ""
