"""Errors that all rows share, as columns: what one standard deviation of each changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.fitting.shared_errors import (
    USUAL_LAW_ERRORS,
    USUAL_MODEL_ERRORS,
    ModelledErrors,
    usual_errors,
)
from soilml.numerics.prior import Prior
from soilml.parameters import declared


def error_columns(case: Case, readings: Readings, errors: Mapping[str, float]) -> dict[str, Floats]:
    r"""Change (m,) of the readings by one standard deviation of each error, by name.

    .. math:: y = (1 + e_1) f(s + e_s, W (1 + e_W), k e^{e_k}) + e_2

    to first order, at the soil of the case. Gains and offsets act on their channel; drawbar pull
    has an error in proportion to load instead of a gain, and gains that grow with slip are in
    proportion to it. Errors of slip, load, bearing and contact act through the model; see
    `ModelledErrors`. One that changes no measured channel is left out.

    errors: Standard deviations by name, as `usual_errors` has them.
    """
    solved = [name for name in declared(ModelledErrors) if name in errors]
    effect = ModelledErrors(typical_load=float(np.median(np.abs(readings.row_load))))
    changed = replace(case, model=case.model + effect) if solved else case
    coordinates = [
        Coordinate(f"{effect.name}.{name}", "1", Prior(0.0, errors[name]), lower=-1.0)
        for name in solved
    ]
    at = linearise(changed, coordinates, np.zeros(len(coordinates)), readings)
    found = dict(zip(solved, np.nan_to_num(at.jacobian).T, strict=True))
    size, slip, load = np.nan_to_num(at.prediction), np.abs(readings.slip), readings.load
    if "strength" in errors:
        by_strength, by_modulus = _laws(case, readings)
        found["strength"] = errors["strength"] * by_strength
        growth = np.log(load / np.median(load))
        found["strength_by_load"] = errors["strength_by_load"] * growth * by_strength
        found["law_of_shear"] = errors["law_of_shear"] * by_modulus
    gains = {"torque": ("torque_gain", size), "sinkage": ("sinkage", size)}
    gains["drawbar_pull"] = "drawbar_pull", load
    for channel, (gain, by) in gains.items():
        factors = {gain: by, f"{channel}_bias": np.ones_like(size), f"{channel}_by_slip": by * slip}
        for name, factor in factors.items():
            if name in errors and channel in readings.channels:
                own = readings.channel == readings.channels.index(channel)
                found[name] = np.where(own, errors[name] * factor, 0.0)
    return found


def _laws(case: Case, readings: Readings) -> tuple[Floats, Floats]:
    """Changes (m,) with the logarithms of strength, c and tan phi, and of shear modulus."""
    tangent = float(np.tan(case.soil.friction_angle))
    units = {
        "cohesion": float(case.soil.cohesion),
        "friction_angle": tangent / (1.0 + tangent**2),
        "shear_modulus": float(case.soil.shear_modulus),
    }
    coordinates = [
        Coordinate(name, "", Prior(value, value + unit), lower=-0.1)
        for name, unit in units.items()
        if unit > 0.0 and (value := float(getattr(case.soil, name))) >= 0.0
    ]
    jacobian = linearise(case, coordinates, np.zeros(len(coordinates)), readings).jacobian
    of = dict(zip((c.path for c in coordinates), np.nan_to_num(jacobian).T, strict=True))
    none = np.zeros(len(readings))
    strength = of.get("cohesion", none) + of.get("friction_angle", none)
    return np.asarray(strength), np.asarray(of.get("shear_modulus", none))


def stacked(columns: Mapping[str, Floats], count: int) -> Floats:
    """Columns (m, k) of m readings as one array."""
    return np.stack(list(columns.values()), axis=1) if columns else np.zeros((count, 0))


def shared_columns(
    case: Case, readings: Readings, soil: Sequence[Coordinate]
) -> tuple[Floats, tuple[Floats, ...]]:
    """Columns (m, k) of sensor errors of unit variance, and of errors inside the model (m, q).

    A sensor has the error that the case declares in [bias], else the typical one; the laws of the
    soil have typical errors, which rows cannot tell from another soil. Errors of bearing, contact
    and channels are of typical size times one amplitude, which is estimated.

    case: With the soil at which the errors are linearised.
    soil: Free parameters; what is free is no error.
    """
    errors = usual_errors(case, readings.row_load, [c.path for c in soil]) | USUAL_LAW_ERRORS
    columns, m = error_columns(case, readings, errors), len(readings)
    of_model = {name: own for name, own in columns.items() if name in USUAL_MODEL_ERRORS}
    others = {name: own for name, own in columns.items() if name not in of_model}
    return stacked(others, m), ((stacked(of_model, m),) if of_model else ())
