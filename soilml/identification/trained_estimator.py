"""A model file for wheels of any size, conditioned on the wheel and soil of a case."""

from __future__ import annotations

import math

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.parameters import declared
from soilml.physics.gears import Wheel
from soilml.physics.soils import Soil
from soilml.quantities import CHANNELS, column

#: Fixed coefficients of the angle of maximum stress in such a file.
FIXED_ANGLE = {"a0": 0.4, "a1": 0.15}


def condition_on_case(estimator: Estimator, case: Case) -> tuple[Estimator, list[str]]:
    """The estimator for a case, and warnings about what it cannot represent of the case.

    Wheel and bearing parameters are the case's, and so are the upper bounds of the priors of
    cohesion and shear modulus. A prior of kphi becomes the standard deviation of the bearing curve,
    and declared noise replaces the file's own.

    Raises
    ------
    InputError
        Where gear, effects or ranges are not those of the file.
    """
    gear, soil, prior = case.model.gear, case.soil, case.prior
    if not isinstance(gear, Wheel):
        raise InputError(f"{estimator.path} is for rigid wheels, not for a {gear.name}")
    if case.model.effects:
        names = ", ".join(effect.name for effect in case.model.effects)
        raise InputError(
            f"{estimator.path} has no effects, the model has {names}; train a file for this model "
            "with [set_posterior], or use soilml identify --method posterior"
        )
    for name, value in FIXED_ANGLE.items():
        if abs(float(getattr(soil, name)) - value) > 1e-9:
            raise InputError(
                f"{estimator.path} is for {name} = {value:g}, the model has "
                f"{float(getattr(soil, name)):g}; train a file for this model with [set_posterior]"
            )
    warnings, upper_bounds = [], {}
    for name in ("cohesion", "shear_modulus"):
        own = prior.get(name)
        if own is None:
            raise InputError(f"{name} has no prior; give its range in [soil.prior]")
        upper_bounds[f"{name}_max"] = own.upper
    bearing = float(soil.kc) / float(gear.width) + float(soil.kphi)
    bearing_std = _log_std(prior["kphi"], bearing) if "kphi" in prior else 0.0
    widest = estimator.sets.context_ranges["bearing_std"][1] if estimator.sets else 0.0
    if bearing_std > widest:
        warnings.append(
            f"the prior of kphi has a standard deviation of a factor {math.exp(bearing_std):.2g}, "
            f"the file allows {math.exp(widest):.2g}: intervals may be too narrow"
        )
    noise = {
        name: (case.noise[column(name)].constant, case.noise[column(name)].share)
        for name in CHANNELS
        if column(name) in case.noise
    }
    conditioned = estimator.on(
        noise=noise,
        wheel_radius=float(gear.radius),
        wheel_width=float(gear.width),
        bearing_modulus=bearing,
        n=float(soil.n),
        bearing_std=min(bearing_std, widest),
        **upper_bounds,
    )
    return conditioned, warnings + _prior_differences(conditioned, case)


def for_simulated_case(estimator: Estimator, case: Case) -> Estimator:
    """A file for many wheels conditioned on the case, without torque bias; any other as it is.

    For readings that were simulated with the case, whose torque sensor has no bias.
    """
    if estimator.sets is None or not estimator.sets.missing_context:
        return estimator
    return condition_on_case(estimator, case)[0].on(noise={"torque_bias": (0.0, 0.0)})


def _log_std(prior: Prior, bearing: float) -> float:
    """Standard deviation of the logarithm of the bearing modulus."""
    if prior.log:
        return math.log(prior.upper / prior.lower) / math.sqrt(12.0)
    return prior.std / max(bearing, 1e-12)


def _prior_differences(estimator: Estimator, case: Case) -> list[str]:
    """Priors that differ from those of the file."""
    texts = []
    for i, name in enumerate(estimator.names):
        own, ends = case.prior.get(name), (estimator.prior.lower[i], estimator.prior.upper[i])
        width = ends[1] - ends[0]
        if (
            own is None
            or own.log
            or max(abs(own.lower - ends[0]), abs(own.upper - ends[1])) > (0.02 * width)
        ):
            unit = declared(Soil)[name].unit
            texts.append(
                f"{name}: the file's prior is uniform from {ends[0]:.4g} to {ends[1]:.4g} {unit}; "
                "that of the model is ignored"
            )
    others = [path for path in case.prior if path not in (*estimator.names, "kphi")]
    if others:
        texts.append(f"{', '.join(others)}: fixed at the model's values; their priors are ignored")
    return texts
