"""Sizes of the errors that all rows share: as declared, and as sensors and models usually have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.config.measurement_noise import KNOWN_PARTS, common_errors
from soilml.physics.effects.exit_angle import ExitAngle
from soilml.physics.gears.base import Gear
from soilml.remarks import Remark

#: Standard deviations of errors that the readings of a drive usually have in common: wheel speed
#: over ground speed, effective radius and gear ratios, current to torque, mass and load transfer,
#: the height at which the wheel touches the ground (m).
USUAL_SENSOR_ERRORS = {
    "slip_bias": 0.015,
    "load_gain": 0.01,
    "torque_gain": 0.03,
    "sinkage_bias": 0.0005,
}
#: Usual offset of a sensor of drawbar pull as a share of a typical load.
PULL_OFFSET_SHARE = 0.01
#: Usual standard deviations of the errors of a wheel's model. A bearing modulus is known to a
#: factor of 1.5. With slip it falls by slip-sinkage, n1 of about 0.2: k z^(n1 s) at z of 2 cm is
#: k exp(-0.8 s). With the logarithm of load it changes in soil of layers, or with an exponent that
#: is off by 0.2. The contact is that of `exit-angle` at its usual size. Models of sinkage and
#: drawbar pull are right to some per cent, of sinkage and of load. Stresses of another shape change
#: all three with slip: from a slip of 0.1 to 0.5 by 4 % of torque, 6 % of sinkage, 4 % of the load.
USUAL_MODEL_ERRORS = {
    "bearing": 0.4,
    "bearing_by_slip": 0.8,
    "bearing_by_load": 0.17,
    "contact": 1.0,
    "sinkage": 0.04,
    "drawbar_pull": 0.02,
    "torque_by_slip": 0.1,
    "sinkage_by_slip": 0.15,
    "drawbar_pull_by_slip": 0.1,
}
#: Effects that stand for an error of a sensor.
EFFECT_OF_ERROR = {
    "slip_bias": "slip-offset",
    "load_gain": "load-gain",
    "torque_bias": "torque-offset",
    "torque_gain": "torque-gain",
    "sinkage_bias": "sinkage-offset",
    "drawbar_pull_bias": "drawbar-offset",
}


def declared_errors(case: Case) -> dict[str, float]:
    """Errors of the sensors that the case declares in [bias], standard deviations by name."""
    return {name: std for name, std in common_errors(case.bias).items() if std > 0.0}


def included_bias(case: Case) -> list[Remark]:
    """A remark with the declared errors that all rows share; none without one."""
    texts = [f"{key} {bias.as_setting()}" for key, bias in case.bias.items() if bias.as_setting()]
    text = f"errors that all rows share are included in std: {', '.join(texts)}"
    return [Remark("bias-included", text, severity="note")] if texts else []


def usual_errors(case: Case, load: NDArray[np.float64], unknown: Sequence[str]) -> dict[str, float]:
    """Errors that sensors and a model usually have, standard deviations by name.

    A sensor that the case declares in [bias], or has as an effect, keeps that error; so does what
    is an unknown or an effect of the model.

    Parameters
    ----------
    case
        Model, soil and bias.
    load
        Loads (n,) of the rows, N.
    unknown
        Paths of the free parameters.
    """
    declared = common_errors(case.bias)
    effects = {
        effect.name for model in (case.model, *case.gears.values()) for effect in model.effects
    }
    usual = {**USUAL_SENSOR_ERRORS, "drawbar_pull_bias": PULL_OFFSET_SHARE * float(np.median(load))}
    of_sensors = {
        name: std
        for name, std in usual.items()
        if _column_of(name) not in case.bias and EFFECT_OF_ERROR[name] not in effects
    }
    gears = [model.gear for model in (case.gears or {"": case.model}).values()]
    nil = without_errors(unknown, effects, gears)
    of_model = {name: std for name, std in USUAL_MODEL_ERRORS.items() if name not in nil}
    return {n: std for n, std in (declared | of_sensors | of_model).items() if std > 0.0}


def without_errors(
    unknown: Sequence[str], effects: Sequence[str] | set[str], gears: Sequence[Gear]
) -> set[str]:
    """Names of errors of the model that a model does not have: its unknowns and its effects."""
    nil = set()
    if "kphi" in unknown or "kc" in unknown:
        nil |= {"bearing"}
    if "n" in unknown:
        nil |= {"bearing_by_load"}
    if any(path.startswith("slip-sinkage") for path in unknown):
        nil |= {"bearing_by_slip"}
    if ExitAngle.name in effects or not all(ExitAngle.applies_to(gear) for gear in gears):
        nil |= {"contact"}
    return nil


def _column_of(name: str) -> str:
    """Column of the sensor whose error has this name."""
    return next(key for key, parts in KNOWN_PARTS.items() if name in parts)
