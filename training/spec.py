"""Training specs: features, targets and regressors, or the ranges of a file for any wheel."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

from datagen.recipe import packaged_file
from soilml.config.measurement_noise import take_noise
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.onboard.features import inputs_of
from soilml.onboard.set_contract import RESPONSE_CHANNELS, SENSOR_ERROR_INPUTS
from soilml.quantities import SHEAR, column
from training.dataset import PER_ROW, check_targets
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.gaussian_regressor import FeatureSubset, GaussianRegressor
from training.regressors.linear_gaussian import LinearGaussian
from training.regressors.lssvm import LSSVM
from training.regressors.scikit_learn import ScikitLearn
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScale, ErrorScales
from training.set_posterior.families.dimensionless_family import DimensionlessFamily
from training.set_posterior.response_surface import ResponseSettings

#: Catalogue of regressors by `[[regressor]] type`: a new one is a file and a line here.
REGRESSORS: dict[str, type[GaussianRegressor]] = {
    **{cls.type_name: cls for cls in (LSSVM, GaussianMLP, LinearGaussian, ScikitLearn)},
    "lssvm": LSSVM,
}

#: Allowed seeds: those of the random generators of all libraries.
SEED = "a whole number from 0 to 2^32 - 1"


@dataclass(frozen=True)
class Spec:
    """What to train from data."""

    name: str  # file name without suffix
    seed: int  # of the split, and of regressors without a seed of their own
    #: inputs of the regressors, such as ``torque/load``, and estimated quantities
    features: tuple[str, ...]
    targets: tuple[str, ...]
    regressors: tuple[FeatureSubset, ...]  # not fitted yet
    text: str  # content of the file as JSON with sorted keys
    #: settings of the set posterior, for targets with one value per run
    set_posterior: ResponseSettings | None = None

    @property
    def per_row(self) -> bool:
        """Whether a target differs between the rows of a run."""
        return any(name in PER_ROW for name in self.targets)


@dataclass(frozen=True)
class AnyWheelSpec:
    """What to train for wheels of any size, from simulated rows."""

    family: DimensionlessFamily  # ranges of wheels, loads and soils
    response: ResponseSettings  # settings of the learned response of the wheel
    #: default noise of the file: constant part in SI units and share of the reading
    noise: dict[str, list[float]]
    text: str  # content of the file as JSON with sorted keys


def read_spec(path: str | os.PathLike[str]) -> Spec:
    """Read a spec from a TOML file, or a packaged one by name.

    Raises `InputError` with the key of the first invalid entry.
    """
    file = packaged_file(path, "training", "specs")
    settings = read_settings(file)
    features = _take_names(settings, "features", ["slip", "torque/load", "load"])
    inputs_of(features)  # raises for an unknown feature
    targets = _take_names(settings, "targets", list(SHEAR))
    try:
        check_targets(targets, features)
    except InputError as error:
        settings.fail(str(error))
    seed = int(settings.take("seed", int, SEED, 0))
    if not 0 <= seed < 2**32:
        settings.fail(f"seed is {seed}; needed is {SEED}")
    regressors: list[FeatureSubset] = []
    for entry in settings.tables("regressor"):
        regressors.append(_take_subset(entry, seed, features, [r.name for r in regressors]))
    if not regressors:
        settings.fail("[[regressor]] is missing; give one or more")
    used = {k for r in regressors for k in r.columns or range(len(features))}
    for k in set(range(len(features))) - used:
        settings.fail(f"features: no regressor reads {features[k]!r}; remove it")
    response = take_response_settings(settings, seed) if "set_posterior" in settings else None
    settings.finish()
    return Spec(
        name=file.stem,
        seed=seed,
        features=tuple(features),
        targets=tuple(targets),
        regressors=tuple(regressors),
        text=json.dumps(settings.content, sort_keys=True),
        set_posterior=response,
    )


def is_any_wheel_spec(path: str | os.PathLike[str]) -> bool:
    """Whether a spec has the table [any_wheel]."""
    return "any_wheel" in read_settings(packaged_file(path, "training", "specs"))


def read_any_wheel_spec(path: str | os.PathLike[str]) -> AnyWheelSpec:
    """Read a spec with [any_wheel] from a TOML file, or a packaged one by name.

    Raises `InputError` with the key of the first invalid entry.
    """
    settings = read_settings(packaged_file(path, "training", "specs"))
    text = json.dumps(settings.content, sort_keys=True)
    seed = int(settings.take("seed", int, "a whole number, 0 or more", 0))
    family = DimensionlessFamily.take(settings.table("any_wheel"))
    noise_table, noise = settings.table("noise"), {}
    for name in RESPONSE_CHANNELS:
        channel_noise = take_noise(noise_table, column(name))
        noise[name] = [channel_noise.constant, channel_noise.share]
    noise_table.finish()
    bias = settings.table("bias")
    if column("torque") in bias:
        torque_bias = take_noise(bias, column("torque"))
        noise["torque_bias"] = [torque_bias.constant, torque_bias.share]
    bias.finish()
    response = take_response_settings(settings, seed)
    settings.finish()
    return AnyWheelSpec(family, response, noise, text)


def _take_names(settings: Settings, key: str, default: list[str]) -> list[str]:
    names = settings.take(key, list, "a list of names", default)
    if not names or not all(isinstance(name, str) for name in names):
        settings.fail(f"{key} is {names!r}; needed is a list of names")
    if len(set(names)) < len(names):
        settings.fail(f"{key} is {names!r}; a name is repeated")
    return [str(name) for name in names]


def _take_subset(
    settings: Settings, seed: int, features: list[str], used_names: list[str]
) -> FeatureSubset:
    """A regressor and the features that it reads; further ones of the same name get a number."""
    own = _take_names(settings, "features", features)
    for feature in own:
        if feature not in features:
            settings.fail(f"features: {feature!r} is none of the spec's: {', '.join(features)}")
    regressor = _take_regressor(settings, seed)
    name, columns = regressor.type_name, None
    if own != features:
        name, columns = f"{name} of {', '.join(own)}", tuple(features.index(f) for f in own)
    count = sum(used == name or used.startswith(f"{name} #") for used in used_names)
    return FeatureSubset(f"{name} #{count + 1}" if count else name, regressor, columns)


def _take_regressor(settings: Settings, seed: int) -> GaussianRegressor:
    """A regressor with its hyperparameters, which take the type of their default."""
    type_name = settings.text("type")
    if type_name not in REGRESSORS:
        settings.fail(f"type is {type_name!r}; there are: {', '.join(REGRESSORS)}")
    regressor = REGRESSORS[type_name]()
    defaults = regressor.get_params()
    settings.permit(defaults)
    parameters = {k: _take_parameter(settings, k, v) for k, v in defaults.items() if k in settings}
    settings.finish()
    if "random_state" in defaults and "random_state" not in parameters:
        parameters["random_state"] = seed
    regressor.set_params(**parameters)
    return regressor


def _take_parameter(settings: Settings, key: str, default: Any) -> Any:
    """A hyperparameter: text, a table, whole numbers, a whole number, or a finite number."""
    if isinstance(default, str):
        return settings.text(key)
    if key == "parameters":
        return settings.take(key, dict, "a table of hyperparameters")
    if isinstance(default, tuple | list):
        values = tuple(settings.take(key, list, "a list of whole numbers"))
        if not all(type(v) is int and 1 <= v <= 4096 for v in values):
            settings.fail(f"{key} is {list(values)}; needed are whole numbers from 1 to 4096")
        return values
    if isinstance(default, int):
        return settings.count(key)
    value = settings.number(key)
    if not 1e-12 <= value <= 1e12:
        settings.fail(f"{key} is {value:g}; needed is a number above zero, 1e-12 to 1e12")
    return value


LEAST_DESIGNS = 512  # With fewer operating conditions no network learns the response of a wheel
#: Upper limits, beyond which training takes days on a laptop.
UPPER_LIMITS = {"designs": 10**7, "hidden": 1024, "epochs": 10**5}
#: Monomials of a file for a microcontroller: with 25, the memory of a set has nearly 4 kB.
LEAST_SMALL_TERMS, MOST_SMALL_TERMS = 10, 25


def take_response_settings(settings: Settings, seed: int) -> ResponseSettings:
    """Read [set_posterior]; raises `InputError` naming the key."""
    table = settings.table("set_posterior")
    counts = {key: table.count(key) for key in UPPER_LIMITS}
    for key, most in UPPER_LIMITS.items():
        if counts[key] > most:
            table.fail(f"{key} is {counts[key]}; needed is at most {most}")
    if counts["designs"] < LEAST_DESIGNS:
        table.fail(f"designs is {counts['designs']}; needed are {LEAST_DESIGNS} or more")
    small = bool(table.take("small", bool, "true or false", False))
    terms = table.count("terms") if "terms" in table else MOST_SMALL_TERMS if small else 0
    if small and not LEAST_SMALL_TERMS <= terms <= MOST_SMALL_TERMS:
        table.fail(
            f"terms is {terms}; a small file needs {LEAST_SMALL_TERMS} to {MOST_SMALL_TERMS}"
        )
    scales, sensors = _take_scales(table), _take_sensor_errors(table)
    table.finish()
    return ResponseSettings(
        **counts, seed=seed, small=small, terms=terms, scales=scales, sensor_errors=sensors
    )


def _take_sensor_errors(table: Settings) -> dict[str, float]:
    """Read [set_posterior.sensor_errors]: standard deviations by input, 0 or more."""
    if "sensor_errors" not in table:
        return {}
    errors = table.table("sensor_errors")
    errors.permit(SENSOR_ERROR_INPUTS)
    found = {name: errors.number(name) for name in SENSOR_ERROR_INPUTS if name in errors}
    for name, std in found.items():
        if std < 0.0:
            errors.fail(f"{name} is {std:g}; needed is a standard deviation of 0 or more")
    errors.finish()
    return found


def _take_scales(table: Settings) -> ErrorScales:
    """Read [[set_posterior.model_errors]], the usual scales where it is missing."""
    if "model_errors" not in table:
        return USUAL_SCALES
    names = ErrorScale._fields
    entries = table.tables("model_errors")
    found = [{name: entry.number(name) for name in names} for entry in entries]
    for entry in entries:
        entry.finish()
    try:
        return ErrorScales.of_list(found)
    except InputError as error:
        table.fail(f"model_errors: {error}")
        raise
