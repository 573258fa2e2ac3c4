"""Usual sizes of the errors of a wheel's model, and the effect that stands for its contact."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.physics.effects.soil.exit_angle import ExitAngle
from soilml.physics.model import Model

#: Standard deviations by `MODEL_ERROR_COLUMNS`. A bearing modulus is known to a factor of 1.5. With
#: slip it falls by slip-sinkage, n1 of about 0.2: k z^(n1 s) at z of 2 cm is k exp(-0.8 s). With
#: the logarithm of load it changes in soil of layers, or with an exponent that is off by 0.2.
#: Models of sinkage and drawbar pull are right to some per cent, of sinkage and of load.
USUAL_MODEL_ERRORS = {
    "bearing": 0.4,
    "bearing_by_slip": 0.8,
    "bearing_by_load": 0.17,
    "contact": 1.0,
    "sinkage": 0.04,
    "drawbar_pull": 0.02,
}


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
    nil = set()
    if "cohesion" not in unknown:  # the change with the bearing modulus is not known then
        nil |= {"bearing", "bearing_by_slip", "bearing_by_load"}
    if "kphi" in unknown:
        nil |= {"bearing"}
    if "n" in unknown:
        nil |= {"bearing_by_load"}
    if any(path.startswith("slip-sinkage.") for path in unknown):
        nil |= {"bearing_by_slip"}
    has_contact = any(isinstance(effect, ExitAngle) for effect in model.effects)
    if has_contact or not ExitAngle.applies_to(model.gear):
        nil |= {"contact"}
    return {name: 0.0 if name in nil else std for name, std in USUAL_MODEL_ERRORS.items()}
