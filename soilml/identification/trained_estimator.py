"""Model files for the wheel and soil of a case: checked, conditioned, with its discrepancy."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import (
    check_wheel_columns,
    effect_differences,
    gear_differences,
    prior_differences,
    recipe_case,
    value_differences,
)
from soilml.config.measurement_noise import common_errors
from soilml.errors import InputError, TableError
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS
from soilml.identification.model_error_inputs import (
    model_error_remarks,
    with_exact_model,
)
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    INFERRED,
    MODEL_ERROR_INPUT,
    OPERATING_NOISE,
)
from soilml.parameters import declared
from soilml.physics.gears import Wheel
from soilml.physics.soils import Soil
from soilml.quantities import CHANNELS, QUANTITIES, column
from soilml.remarks import Remark

#: Fixed coefficients of the angle of maximum stress in such a file.
FIXED_ANGLE = {"a0": 0.4, "a1": 0.15}
#: Distance of the ends of two priors, in widths, up to which they are the same.
SAME_PRIOR = 0.02
_HINT = "select rows with --where, or train a model for this wheel"


def condition_on_case(estimator: Estimator, case: Case) -> tuple[Estimator, list[Remark]]:
    """The estimator for a case, and warnings about what it cannot represent of the case.

    Wheel and bearing parameters are the case's, and so are the upper bounds of the priors of
    cohesion and shear modulus. A prior of kphi becomes the standard deviation of the bearing curve,
    and declared noise replaces the file's own.

    Raises `InputError` where gear, effects or ranges are not those of the file.
    """
    gear, soil, prior = case.model.gear, case.soil, case.prior
    if not isinstance(gear, Wheel):
        raise InputError(f"{estimator.path} is for rigid wheels, not for a {gear.name}")
    names = ", ".join(effect.name for effect in case.model.effects)
    wrong = [f"has no effects, the model has {names}"] if names else []
    wrong += [
        f"is for {name} = {value:g}, the model has {float(getattr(soil, name)):g}"
        for name, value in FIXED_ANGLE.items()
        if abs(float(getattr(soil, name)) - value) > 1e-9
    ]
    if wrong:
        raise InputError(
            f"{estimator.path} {wrong[0]}; train a file for this model with [set_posterior], or "
            "use soilml identify --method posterior"
        )
    warnings: list[Remark] = []
    bounded = ("cohesion", "shear_modulus")
    if missing := [name for name in bounded if name not in prior]:
        raise InputError(f"{missing[0]} has no prior; give its range in [soil.prior]")
    upper_bounds = {f"{name}_max": prior[name].upper for name in bounded}
    bearing = float(soil.kc) / float(gear.width) + float(soil.kphi)
    widest = estimator.sets.context_ranges["bearing_std"][1] if estimator.sets else 0.0
    kphi, bearing_std = prior.get("kphi"), 0.0  # of the logarithm of the bearing modulus
    if kphi is not None and kphi.log:
        bearing_std = math.log(kphi.upper / kphi.lower) / math.sqrt(12.0)
    elif kphi is not None:
        bearing_std = kphi.std / max(bearing, 1e-12)
    infers = estimator.sets and estimator.sets.common_errors.get(MODEL_ERROR_INPUT) == INFERRED
    if infers and kphi is None:
        bearing_std = USUAL_MODEL_ERRORS["bearing"]
        text = (
            f"kphi has no prior: its logarithm is taken to be off by {bearing_std:g}, as is usual; "
            "give its prior, or --exact-model where it is known"
        )
        warnings.append(Remark("bearing-assumed", text, ("kphi",), "note"))
    if bearing_std > widest:
        text = (
            f"the prior of kphi has a standard deviation of a factor {math.exp(bearing_std):.2g}, "
            f"the file allows {math.exp(widest):.2g}: intervals may be too narrow"
        )
        warnings.append(Remark("prior-too-wide", text, ("kphi",)))
    conditioned = with_sensors_of(estimator, case).on(
        noise=None,
        wheel_radius=float(gear.radius),
        wheel_width=float(gear.width),
        bearing_modulus=bearing,
        n=float(soil.n),
        bearing_std=min(bearing_std, widest),
        **upper_bounds,
    )
    return conditioned, warnings + _prior_differences(conditioned, case)


def with_sensors_of(estimator: Estimator, case: Case) -> Estimator:
    """The estimator of a file with a set posterior, with the noise and bias that a case declares.

    Raises `InputError` where the file takes as exact what the case declares to have an error.
    """
    noise = {
        name: (case.noise[column(name)].constant, case.noise[column(name)].share)
        for name in (*CHANNELS, *OPERATING_NOISE)
        if column(name) in case.noise
    }
    errors = common_errors(case.bias)
    if "torque_bias" in errors:
        noise["torque_bias"] = (errors.pop("torque_bias"), 0.0)
    return estimator.on(noise, **errors)


def for_simulated_case(estimator: Estimator, case: Case) -> Estimator:
    """A file with sensors without common errors, conditioned on the case if it is for many wheels.

    For readings that were simulated with the case, whose sensors have noise alone.
    """
    if estimator.sets is None:
        return estimator
    exact: dict[str, Any] = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
    if not estimator.sets.missing_context:
        return estimator.on(**exact)
    conditioned = condition_on_case(with_exact_model(estimator), case)[0]
    return conditioned.on(noise={"torque_bias": (0.0, 0.0)}, **exact)


def narrower_priors(estimator: Estimator, case: Case) -> dict[str, tuple[float, float]]:
    """Ends of the case's uniform priors that lie in those of a file and are not the same."""
    found = {}
    for i, name in enumerate(estimator.names):
        own, low, high = case.prior.get(name), estimator.prior.lower[i], estimator.prior.upper[i]
        slack = SAME_PRIOR * (high - low)
        if own is None or own.log or own.normal_std is not None:
            continue
        inside = low - slack <= own.lower and own.upper <= high + slack
        if inside and max(own.lower - low, high - own.upper) > slack:
            found[name] = (float(max(own.lower, low)), float(min(own.upper, high)))
    return found


def _prior_differences(estimator: Estimator, case: Case) -> list[Remark]:
    """Priors that differ from those of the file."""
    remarks, used = [], narrower_priors(estimator, case)
    for i, name in enumerate(estimator.names):
        own, low, high = case.prior.get(name), estimator.prior.lower[i], estimator.prior.upper[i]
        uniform = own is not None and not own.log and own.normal_std is None
        off = max(abs(own.lower - low), abs(own.upper - high)) if own is not None else np.inf
        if name not in used and not (uniform and off <= SAME_PRIOR * (high - low)):
            text = f"{name}: the file's prior is uniform from {low:.4g} to {high:.4g} "
            text += f"{declared(Soil)[name].unit}; that of the model is ignored"
            remarks.append(Remark("prior-ignored", text, (name,)))
    others = [path for path in case.prior if path not in (*estimator.names, "kphi")]
    if others:
        text = f"{', '.join(others)}: fixed at the model's values; their priors are ignored"
        remarks.append(Remark("prior-ignored", text, tuple(others)))
    return remarks


def estimators_for_case(
    estimators: Sequence[Estimator], case: Case | None, name: str, *, pooled: bool
) -> tuple[list[Estimator], list[Remark]]:
    """The estimators for the wheel and soil of a case, and remarks on what is ignored of it.

    case, name: The case, if there is one, and the name of its file.
    pooled: Whether all rows of a soil are estimated together.

    Raises `InputError` where a file for wheels of any size has no case, and where the gear or the
    effects of the case are not those of a file.
    """
    given, remarks = [], []
    for loaded in estimators:
        stated = case is not None and (case.discrepancy or case.remainder is not None)
        estimator = with_exact_model(loaded) if stated else loaded  # it has no other errors
        if estimator.sets is not None and estimator.sets.missing_context:
            if case is None:
                raise InputError(
                    f"{estimator.path} is for wheels of any size: give --model MODEL.toml with "
                    "your [gear], [soil], [soil.prior] and [noise]"
                )
            estimator, own = condition_on_case(estimator, case)
            remarks += own
        elif case is not None:
            together = estimator.sets is not None and pooled
            remarks += _compare(estimator, case, name, together)
            estimator = with_sensors_of(estimator, case) if together else estimator
        given.append(estimator)
    if case is not None:
        remarks += model_error_remarks(given[0], case, pooled=pooled)
        if case.soil_tests:
            text = "[[soil.test]] is ignored: a file for the board takes no tests of the soil"
            remarks.append(Remark("soil-tests-ignored", text))
    return given, remarks


def _compare(estimator: Estimator, case: Case, name: str, together: bool) -> list[Remark]:
    """Remarks on what differs between a file for one wheel and the case.

    Raises `InputError` where gear or effects do.
    """
    own = recipe_case(estimator.metadata["recipe"], estimator.path)
    if own is None:
        text = f"{estimator.path} does not state its wheel: it cannot be compared with {name}"
        return [Remark("wheel-not-stated", text)]
    wrong = [
        *gear_differences(case, own, name),
        *effect_differences(case, own, name),
        *value_differences(case, own, ("effects",), name),
    ]
    if wrong:
        raise InputError(
            f"{estimator.path} is not for the wheel of {name}: {'; '.join(wrong)}; train a file "
            "for this model, or correct [gear] and [[effect]]"
        )
    used = narrower_priors(estimator, case) if together else {}
    different = chain(
        value_differences(case, own, ("soil",), name),
        prior_differences(case, own, [n for n in estimator.names if n not in used], name),
        () if together else _noise_differences(case, own, name),
    )
    return [
        Remark("ignored-setting", f"{estimator.path}: {text}, which is ignored")
        for text in different
    ]


def _noise_differences(case: Case, own: Case, name: str) -> Iterator[str]:
    """Declared noise of the case that is not that of the file."""
    for key, noise in case.noise.items():
        if noise != own.noise.get(key):
            yield f"noise of {key} as in its recipe, {name} has another one"
    if case.bias:
        yield f"no bias of {', '.join(case.bias)}, {name} declares it"


def check_table_wheel(estimator: Estimator, table: Table) -> None:
    """Raise `TableError` where the table's wheel columns differ from the wheel of the training."""
    gear = json.loads(estimator.metadata["gear"])
    fixed = estimator.sets.context_values if estimator.sets is not None else {}
    sizes = {n: fixed.get(f"wheel_{n}", gear.get(n)) for n in ("radius", "width")}
    check_wheel_columns(table, sizes, "the model was trained for", _HINT)
    effects = json.loads(estimator.metadata["recipe"]).get("effect", [])
    key = QUANTITIES["grouser_height"].column
    if key in table and not any(effect["name"] == "grousers" for effect in effects):
        lugs = table[key] > 0.0
        if lugs.any():
            row = int(np.argmax(lugs))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was "
                f"trained for a wheel without lugs; {_HINT}"
            )
