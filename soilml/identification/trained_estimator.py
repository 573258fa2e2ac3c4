"""A file for wheels of any size, made to answer for the wheel and soil of a case."""

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

#: What the file takes for given of the place of the maximum stress.
PLACE = {"a0": 0.4, "a1": 0.15}


def condition_on_case(estimator: Estimator, case: Case) -> tuple[Estimator, list[str]]:
    """The estimator for a case, and what of the case it cannot follow, in words.

    Wheel and bearing values are the case's; the prior's upper ends are those of cohesion and shear
    modulus; a prior of kphi becomes the standard deviation of the bearing curve; declared noise
    replaces the file's own. Raises `InputError` where gear, effects or ranges are not the file's.
    """
    gear, soil, prior = case.model.gear, case.soil, case.prior
    if not isinstance(gear, Wheel):
        raise InputError(f"{estimator.path} is for rigid wheels, not for a {gear.name}")
    if case.model.effects:
        names = ", ".join(effect.name for effect in case.model.effects)
        raise InputError(
            f"{estimator.path} knows no effects, the model has {names}; train a file of its own "
            "with [set_posterior], or take soilml identify --method posterior"
        )
    for name, value in PLACE.items():
        if abs(float(getattr(soil, name)) - value) > 1e-9:
            raise InputError(
                f"{estimator.path} takes {name} for {value:g}, the model has "
                f"{float(getattr(soil, name)):g}; train a file of its own with [set_posterior]"
            )
    said, given = [], {}
    for name in ("cohesion", "shear_modulus"):
        ends = prior.get(name)
        if ends is None:
            raise InputError(f"{name} has no prior; give its range in [soil.prior]")
        given[f"{name}_max"] = ends.upper
    bearing = float(soil.kc) / float(gear.width) + float(soil.kphi)
    near = _log_std(prior["kphi"], bearing) if "kphi" in prior else 0.0
    widest = estimator.sets.context_ranges["bearing_std"][1] if estimator.sets else 0.0
    if near > widest:
        said.append(
            f"kphi may stray by a factor of {math.exp(near):.2g}, the file follows "
            f"{math.exp(widest):.2g}: intervals may be too narrow"
        )
    noise = {
        name: (case.noise[column(name)].constant, case.noise[column(name)].share)
        for name in CHANNELS
        if column(name) in case.noise
    }
    found = estimator.on(
        noise=noise,
        wheel_radius=float(gear.radius),
        wheel_width=float(gear.width),
        bearing_modulus=bearing,
        n=float(soil.n),
        bearing_std=min(near, widest),
        **given,
    )
    return found, said + _not_followed(found, case)


def for_simulated_case(estimator: Estimator, case: Case) -> Estimator:
    """A file for many wheels on the case's; any other as it is.

    For sets that the case made: the sensor of the torque has no bias.
    """
    if estimator.sets is None or not estimator.sets.missing_context:
        return estimator
    return condition_on_case(estimator, case)[0].on(noise={"torque_bias": (0.0, 0.0)})


def _log_std(prior: Prior, bearing: float) -> float:
    """Standard deviation of the logarithm of the bearing modulus."""
    if prior.log:
        return math.log(prior.upper / prior.lower) / math.sqrt(12.0)
    return prior.std / max(bearing, 1e-12)


def _not_followed(estimator: Estimator, case: Case) -> list[str]:
    """Priors that are not those of the file, in words."""
    said = []
    for i, name in enumerate(estimator.names):
        own, ends = case.prior.get(name), (estimator.prior.lower[i], estimator.prior.upper[i])
        width = ends[1] - ends[0]
        if (
            own is None
            or own.log
            or max(abs(own.lower - ends[0]), abs(own.upper - ends[1])) > (0.02 * width)
        ):
            unit = declared(Soil)[name].unit
            said.append(
                f"{name}: the file takes {ends[0]:.4g} to {ends[1]:.4g} {unit} for equally likely, "
                "whatever the model says"
            )
    others = [path for path in case.prior if path not in (*estimator.names, "kphi")]
    if others:
        said.append(f"{', '.join(others)}: taken for known, whatever their prior says")
    return said
