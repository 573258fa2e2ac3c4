"""Usual errors of a wheel's model that a family has, and the effect of its contact."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.fitting.shared_errors_sizes import USUAL_MODEL_ERRORS, without_errors
from soilml.physics.effects.soil.exit_angle import ExitAngle
from soilml.physics.model import Model


def usual_contact() -> ExitAngle:
    """The effect `exit-angle` at its usual size."""
    return ExitAngle(**ExitAngle.about.reference)


def usual_model_errors(unknown: Sequence[str], model: Model) -> dict[str, float]:
    """The usual errors, without those that the model has as unknowns or as effects.

    Parameters
    ----------
    unknown : sequence of str
        Unknowns by their dotted paths.
    model : Model
        Gear, which need not be a rigid wheel, and effects.
    """
    nil = without_errors(unknown, {effect.name for effect in model.effects}, [model.gear])
    if "cohesion" not in unknown:  # the change with the bearing modulus is not known then
        nil |= {"bearing", "bearing_by_slip", "bearing_by_load"}
    return {name: 0.0 if name in nil else std for name, std in USUAL_MODEL_ERRORS.items()}
