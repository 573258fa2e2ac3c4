"""A case: gear, effects, soil, priors, sensor noise and discrepancy, as in a model file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any

from soilml.config.measurement_noise import Noise, take_noise
from soilml.config.model_discrepancy import Discrepancy, take_discrepancy
from soilml.config.prior_settings import take_prior
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter, check, declared, located, with_values
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.gears import GEARS
from soilml.physics.model import Model
from soilml.physics.soils import Soil, soil
from soilml.quantities import COLUMNS


@dataclass(frozen=True)
class Case:
    """A model on a soil, with priors, sensor noise and model discrepancy.

    Attributes
    ----------
    model
        Gear and effects.
    soil
        Soil parameters.
    prior
        Priors by the paths of `parameters()`: `cohesion`, `kphi`, `slip-sinkage.n1`.
    noise
        Noise of the sensors by column name: `torque_Nm`, `slip`.
    discrepancy
        Smooth error of the model by column name: `torque_Nm`, `drawbar_pull_N`, `sinkage_m`.
    """

    model: Model
    soil: Soil
    prior: dict[str, Prior] = field(default_factory=dict)
    noise: dict[str, Noise] = field(default_factory=dict)
    discrepancy: dict[str, Discrepancy] = field(default_factory=dict)

    def parameters(self) -> dict[str, tuple[Parameter, Any]]:
        """Every parameter by path, with its declaration and its value."""
        own = located(self.soil)
        for path, entry in located(self.model).items():
            own[path.removeprefix("effects.")] = entry
        return own

    def with_values(self, new: dict[str, Any]) -> Case:
        """The same case with some parameters replaced, by path."""
        unknown = sorted(new.keys() - self.parameters().keys())
        if unknown:
            raise InputError(
                f"no parameter {unknown[0]!r}; this model has: {', '.join(self.parameters())}"
            )
        soils = located(self.soil)
        model = {
            path if path.startswith("gear.") else f"effects.{path}": value
            for path, value in new.items()
            if path not in soils
        }
        return replace(
            self,
            model=with_values(self.model, model),
            soil=with_values(self.soil, {p: v for p, v in new.items() if p in soils}),
        )


def read_case(path: str | os.PathLike[str], effects: Mapping[str, type[Effect]] = EFFECTS) -> Case:
    """Read a case from a TOML model file.

    Parameters
    ----------
    path
        The file: tables [gear], [soil] with [soil.prior], [[effect]], [noise] and [discrepancy].
    effects
        Effects that [[effect]] may name; those of the catalogue by default.

    Returns
    -------
    Case

    Raises
    ------
    InputError
        Names file, table and key of what is missing, unknown or out of bounds.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> text = '''
    ... [gear]
    ... type = "wheel"
    ... radius = 0.15
    ... width = 0.12
    ... [soil]
    ... name = "wong1989/dry_sand"
    ... [soil.prior]
    ... friction_angle = [0.4, 0.8]
    ... [noise]
    ... torque_Nm = "2 %"
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "model.toml"
    ...     _ = path.write_text(text)
    ...     case = read_case(path)
    >>> print(case.model.gear.name, case.prior["friction_angle"], case.noise["torque_Nm"].share)
    wheel Prior(lower=0.4, upper=0.8, log=False) 0.02
    """
    settings = read_settings(path)
    case = take_case(settings, effects)
    settings.finish()
    return case


def take_case(settings: Settings, effects: Mapping[str, type[Effect]] = EFFECTS) -> Case:
    """The case in the tables that `read_case` reads; others are left unread."""
    gear_settings = settings.table("gear")
    gear_type = gear_settings.text("type")
    if gear_type not in GEARS:
        gear_settings.fail(f"type is {gear_type!r}; there are: {', '.join(GEARS)}")
    gear = _instance(GEARS[gear_type], gear_settings)
    gear_settings.finish()
    own_soil, prior = _take_soil(settings.table("soil"))
    model = Model(gear)
    for entry in settings.tables("effect"):
        name = entry.text("name")
        if name not in effects:
            entry.fail(f"name is {name!r}; there are: {', '.join(effects)}")
        priors = entry.table("prior")
        try:
            model = model + _instance(effects[name], entry)
        except InputError as error:
            entry.fail(str(error).removeprefix(f"{entry.where}: "))
        entry.finish()
        prior |= {f"{name}.{k}": v for k, v in _take_priors(priors, effects[name]).items()}
    noise = {}
    noise_settings = settings.table("noise")
    noise_settings.permit(COLUMNS)
    for key in COLUMNS:
        if key in noise_settings:
            noise[key] = take_noise(noise_settings, key)
    noise_settings.finish()
    discrepancy = take_discrepancy(settings.table("discrepancy"))
    return Case(model, own_soil, prior, noise, discrepancy)


def _instance(cls: type, settings: Settings) -> Any:
    """An instance of a parameter-bearing dataclass from a table's keys of the same names."""
    values = {
        f.name: (settings.text if isinstance(f.default, str) else settings.number)(f.name)
        for f in fields(cls)
        if f.name in settings or f.default is MISSING
    }
    settings.permit(f.name for f in fields(cls))
    try:
        made = cls(**values)
    except InputError as error:
        settings.fail(str(error))
    check(made, f"{settings.where}: ")
    return made


def _take_soil(settings: Settings) -> tuple[Soil, dict[str, Prior]]:
    priors = settings.table("prior")
    if "name" in settings:
        name = settings.text("name")
        try:
            base = soil(name)
        except InputError as error:
            settings.fail(str(error))
        values = {k: settings.number(k) for k in declared(Soil) if k in settings}
        settings.permit(declared(Soil))
        made = with_values(base, values)
        check(made, f"{settings.where}: ")
    else:
        made = _instance(Soil, settings)
    settings.finish()
    return made, _take_priors(priors, Soil)


def _take_priors(settings: Settings, cls: type) -> dict[str, Prior]:
    priors = {}
    settings.permit(declared(cls))
    for key, parameter in declared(cls).items():
        if key in settings:
            prior = take_prior(settings, key)
            if not parameter.lower <= prior.lower < prior.upper <= parameter.upper:
                settings.fail(
                    f"{key} is [{prior.lower:g}, {prior.upper:g}]; it must lie between "
                    f"{parameter.lower:g} and {parameter.upper:g} {parameter.unit}"
                )
            priors[key] = prior
    settings.finish()
    return priors
