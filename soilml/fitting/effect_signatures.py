"""Signatures of effects: how the readings change with each effect of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.candidate_effects import gears_differ, with_effect
from soilml.fitting.coordinates import size_coordinate
from soilml.fitting.levels import covariate_levels
from soilml.fitting.predictions import linearise, predict
from soilml.fitting.readings import Readings
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import COVARIATES, FROM_ORDER
from soilml.remarks import Remark

#: Step of the secant that gives a signature, in reference sizes. A secant is used because some
#: effects start with a square root, whose derivative at zero is infinite.
SECANT_STEP = 0.5
MIN_CHANGE = 1e-6  # A signature below this fraction of every reading's noise counts as zero


@dataclass(frozen=True)
class Signature:
    """Change of every reading, (m,), per reference size of an effect."""

    name: str
    kind: str
    column: Floats
    sign: int  # 1 or -1 where the size can only change in that direction, 0 where it can in both


def current_size(case: Case, path: str, unit: float) -> float:
    """Coordinate of an effect's size in the case, in reference sizes; 0 where it is absent."""
    parameters = case.parameters()
    return float(parameters[path][1]) / unit if path in parameters else 0.0


def effect_signatures(
    case: Case, readings: Readings, effects: Mapping[str, type[Effect]]
) -> tuple[list[Signature], dict[str, Remark]]:
    """Signatures of the effects that these runs can test, and why they cannot test the others.

    An effect that the case has already is changed from its present size, which may be wrong.
    """
    base = linearise(case, [], np.zeros(0), readings)
    sinkage = replace(base.sinkage_at(np.zeros((1, 0))), nearest=True, rough=True)
    signatures: list[Signature] = []
    reasons: dict[str, Remark] = {}
    for name, effect in effects.items():
        if reason := _missing_covariate(case, effect, readings):
            reasons[name] = reason
            continue
        size = size_coordinate(effect, None)
        try:
            changed = with_effect(case, effect)
            at = current_size(changed, size.path, size.reference_size)
            step = SECANT_STEP if size.upper >= at + SECANT_STEP else -SECANT_STEP
            x = np.asarray([[at + step]])
            (prediction,) = predict(changed, [size], x, readings, sinkage)
            if not np.isfinite(prediction).all():  # by the full search
                (prediction,) = predict(changed, [size], x, readings)
        except InputError as error:
            reasons[name] = Remark("refused", str(error), (name,))
            continue
        column = (prediction - base.prediction) / step
        if not np.isfinite(column).all():
            text = "with it, the model has no equilibrium in some row"
            reasons[name] = Remark("no-equilibrium", text, (name,))
        elif not np.any(np.abs(column) > MIN_CHANGE * readings.std):
            reasons[name] = Remark("no-change", "it changes no measured quantity", (name,))
        else:
            sign = 0 if size.lower < at < size.upper else int(np.sign(step))
            signatures.append(Signature(name, effect.about.kind, column, sign))
    return signatures, reasons


def _missing_covariate(case: Case, effect: type[Effect], readings: Readings) -> Remark | None:
    """What these runs lack to test an effect; None where they have it."""
    if effect.about.varied and not gears_differ(case, effect.about.varied_dimension):
        return Remark("unvaried-gear", f"needs {effect.about.varied}", (effect.name,))
    for field in (*effect.about.needs, *effect.about.uses):
        value = getattr(readings.at, field)
        if value is None:
            text = f"needs the column {COVARIATES[field]}"
            return Remark("missing-column", text, (effect.name,))
        values = np.broadcast_to(value, readings.run.shape)
        varies = bool(np.ptp(values) > 0.0)
        if field not in FROM_ORDER:
            varies = covariate_levels(field, values, readings.run).count > 1
        if not varies:
            text = f"needs runs at several values of {COVARIATES[field]}"
            return Remark("constant-column", text, (effect.name,))
    return None
