"""A case: gear, effects, soil, priors, sensor noise and discrepancy, as in a model file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from soilml.config.explanations import (
    CaseExplanation,
    one_of,
    take_explanations,
    with_suspects_explained,
)
from soilml.config.measurement_noise import (
    Discrepancy,
    Noise,
    take_bias,
    take_discrepancy,
    take_noise,
    unestimated_bias,
)
from soilml.config.model_settings import (
    UNNAMED_GEAR,
    take_effects,
    take_gear,
    take_gears,
    take_soil,
)
from soilml.config.remainder import Remainder, take_remainder
from soilml.config.simulator import (
    Simulator,
    emulated,
    take_simulator,
    with_emulator_error,
)
from soilml.config.wheeled_rover import DriveErrors, WheeledRover, take_rover
from soilml.errors import InputError
from soilml.io.declared_settings import take_declared
from soilml.io.table import Table
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter, located, with_values
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.model import Model
from soilml.physics.soils import Soil
from soilml.physics.soils.soil_tests import SoilTest
from soilml.quantities import COLUMNS


@dataclass(frozen=True)
class Case:
    """A model on a soil, with priors, sensor noise and model discrepancy."""

    model: Model  # Gear and effects
    soil: Soil
    # Priors by the paths of `parameters()`: `cohesion`, `kphi`, `slip-sinkage.n1`
    prior: dict[str, Prior] = field(default_factory=dict)
    # Noise of the sensors by column name: `torque_Nm`, `slip`
    noise: dict[str, Noise] = field(default_factory=dict)
    # Smooth error of the model by column name: `torque_Nm`, `drawbar_pull_N`, `sinkage_m`
    discrepancy: dict[str, Discrepancy] = field(default_factory=dict)
    # Where several gears were driven: each by its name in the column `gear` of a table, with the
    # effects of its own; `model` has the effects that all share, on the first gear. A gear's own
    # effect replaces a shared one of the same name. Empty where there is one gear
    gears: dict[str, Model] = field(default_factory=dict)
    # Errors that all readings of a sensor share, by column name: `torque_Nm`, `slip`
    bias: dict[str, Noise] = field(default_factory=dict)
    rover: WheeledRover | None = None  # The vehicle on such gears, where the file describes it
    soil_tests: tuple[SoilTest, ...] = ()  # Plate and shear tests, which take part like readings
    # What a gap analysis learned of the readings that soil and effects do not explain; its mean is
    # a part of every prediction
    remainder: Remainder | None = None
    # Another program whose runs stand in for the equations; the error of their emulator is a part
    # of `discrepancy`
    simulator: Simulator | None = None
    drive: DriveErrors = field(default_factory=DriveErrors)  # Of drives: beside the torque on soil
    # Explanations of a gap analysis with their probabilities, whose mixture is every prediction,
    # beside the one remainder; empty where the case is the whole answer
    explanations: tuple[CaseExplanation, ...] = ()

    @property
    def states_model_error(self) -> bool:
        """Whether the file states the error of its model, beyond that of an emulator."""
        of_emulator = self.simulator is not None and not self.simulator.states_discrepancy
        return self.remainder is not None or bool(self.discrepancy and not of_emulator)

    def parameters(self) -> dict[str, tuple[Parameter, Any]]:
        """Every parameter by path, with its declaration and its value.

        Parameters of one of several gears are `gears.lugged.radius` and `grousers@lugged.height`.
        """
        return dict(self._parameters)

    @cached_property
    def numbers(self) -> dict[str, Any]:
        """The value of every parameter by path."""
        return {path: value for path, (_, value) in self._parameters.items()}

    @cached_property
    def _parameters(self) -> dict[str, tuple[Parameter, Any]]:
        own = located(self.soil)
        for path, entry in located(self.model).items():
            if not (self.gears and path.startswith("gear.")):
                own[path.removeprefix("effects.")] = entry
        for name, model in self.gears.items():
            own |= {_path_of_gear(name, path): entry for path, entry in located(model).items()}
        return own

    def with_values(self, new: dict[str, Any]) -> Case:
        """The same case with some parameters replaced, by path."""
        unknown = sorted(new.keys() - self._parameters.keys())
        if unknown:
            raise InputError(
                f"no parameter {unknown[0]!r}; this model has: {', '.join(self.parameters())}"
            )
        soils = located(self.soil)
        gears, of_gears = {}, set()
        for name, own in self.gears.items():
            paths = {path: _path_of_gear(name, path) for path in located(own)}
            gears[name] = with_values(own, {p: new[o] for p, o in paths.items() if o in new})
            of_gears |= set(paths.values())
        model = {
            path if path.startswith("gear.") else f"effects.{path}": value
            for path, value in new.items()
            if path not in soils and path not in of_gears
        }
        return replace(
            self,
            model=with_values(self.model, model),
            soil=with_values(self.soil, {p: v for p, v in new.items() if p in soils}),
            gears=gears,
        )

    def of_gear(self, name: str) -> Case:
        """The case of one of several gears: its dimensions, its effects and the shared ones."""
        own = self.gears[name]
        replaced = {effect.name for effect in own.effects}
        shared = [effect for effect in self.model.effects if effect.name not in replaced]
        remainder = None if self.remainder is None else self.remainder.of_gear(name)
        model = Model(own.gear, (*shared, *own.effects))
        each = tuple(
            CaseExplanation.of(e.weight, self.of_explanation(e).of_gear(name))
            for e in self.explanations
        )
        paths = self.paths_of_gear(name)
        prior = {paths[path]: prior for path, prior in self.prior.items() if path in paths}
        return replace(
            self, model=model, prior=prior, gears={}, remainder=remainder, explanations=each
        )

    def without_remainder_of(self, table: Table) -> Case:
        """Without a remainder that was learned from rows of a table, which would count twice."""
        if self.remainder is None or not self.remainder.learned_from(table):
            return self
        return replace(self, remainder=None)

    def without_learned_discrepancy(self) -> Case:
        """Without the discrepancy that an earlier analysis learned: a further one finds it anew."""
        known = [] if self.remainder is None else self.remainder.columns
        left = {k: d for k, d in self.discrepancy.items() if not d.learned and k not in known}
        return replace(self, discrepancy=left)

    def of_explanation(self, one: CaseExplanation) -> Case:
        """The case as one of its explanations has it, beside the remainder of all of them."""
        return replace(
            self,
            model=one.model,
            gears=one.gears,
            soil=one.soil,
            prior=one.prior,
            bias=unestimated_bias(self.bias, set(one.effects)),
            explanations=(),
        )

    def without_explanations(self) -> Case:
        """The case before them: without the remainder beside them too."""
        return replace(self, explanations=(), remainder=None) if self.explanations else self

    def paths_of_gear(self, name: str) -> dict[str, str]:
        """Paths of the parameters that act on one of several gears: here, and in `of_gear`."""
        own = self.gears[name]
        replaced = {effect.name for effect in own.effects}
        paths = {path: path for path in located(self.soil)}
        for path in located(Model(own.gear, self.model.effects)):
            public = path.removeprefix("effects.")
            if path.startswith("effects.") and public.partition(".")[0] not in replaced:
                paths[public] = public
        for path in located(own):
            paths[_path_of_gear(name, path)] = path.removeprefix("effects.")
        return paths


def _path_of_gear(name: str, path: str) -> str:
    """Path in the case of a parameter of one of several gears, from that in the gear's model."""
    kind, _, rest = path.partition(".")
    if kind == "effects":
        effect, _, parameter = rest.partition(".")
        return f"{effect}@{name}.{parameter}"
    return path if name == UNNAMED_GEAR else f"gears.{name}.{rest}"


def read_case(
    path: str | os.PathLike[str],
    effects: Mapping[str, type[Effect]] = EFFECTS,
    with_bias: bool = False,
    with_simulator: bool = True,
    names_files: bool = True,
    with_explanations: bool = False,
) -> Case:
    """Read a case from a TOML model file.

    Parameters
    ----------
    path
        The file: tables [gear] or several [gears.NAME], [soil] with [soil.prior], [[effect]],
        [noise], [discrepancy], [remainder], [simulator] and [rover].
    effects
        Effects that [[effect]] may name; those of the catalogue by default.
    with_bias
        Whether [bias] is read; otherwise it is refused, so that nobody takes it as used where it is
        not.
    with_simulator
        Whether the runs of [simulator] take the place of the equations; otherwise they are not
        read.
    names_files
        Whether the model file may name others, which lie beside it; not a text that others wrote.
    with_explanations
        Whether several tables [[explanation]] are read; otherwise they are refused, since the
        caller needs one model.

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
    settings = read_settings(path, f"soilml init {path}", names_files)
    settings = Settings(with_suspects_explained(settings.content), settings.where, settings.folder)
    case = take_case(settings, effects, with_simulator)
    if with_bias:
        case = replace(case, bias=take_bias(settings.table("bias")))
    elif "bias" in settings:
        settings.fail(
            "[bias] is read by identify, pull, gap and estimate --model alone (in Python, "
            "with_bias=True); for other commands delete it"
        )
    settings.finish()
    return case if with_explanations else one_of(case, str(path))


def read_case_of_one_gear(
    path: str | os.PathLike[str],
    effects: Mapping[str, type[Effect]] = EFFECTS,
    gear: str | None = None,
    with_bias: bool = False,
    with_explanations: bool = False,
) -> Case:
    """Read the case of one gear; `gear` names it where the file has several.

    The tables [bias] and [[explanation]] are read as by `read_case`.

    Raises `InputError` as `read_case` does, and where the file has several gears and none of this
    name.
    """
    case = read_case(path, effects, with_bias, with_explanations=with_explanations)
    return case_of_one_gear(case, path, gear)


def case_of_one_gear(case: Case, path: str | os.PathLike[str], gear: str | None) -> Case:
    """The case of the gear of this name, of the file `path`; raises as `read_case_of_one_gear`."""
    if not case.gears and gear is None:
        return case
    if gear in case.gears:
        return case.of_gear(gear)
    known = ", ".join(case.gears)
    if not case.gears:
        raise InputError(f"{path} has one gear, in [gear]; omit --gear")
    if gear is not None:
        raise InputError(f"{path} has no gear {gear!r}; there are: {known}")
    raise InputError(
        f"{path} has several gears: {known}; choose one with --gear, which also selects its rows, "
        "where the table has a column gear"
    )


def take_case(
    settings: Settings, effects: Mapping[str, type[Effect]] = EFFECTS, with_simulator: bool = True
) -> Case:
    """The case in the tables that `read_case` reads; others are left unread."""
    gears: dict[str, Model] = {}
    gear_priors: dict[str, Prior] = {}
    if "gears" in settings:
        gears, gear_priors = take_gears(settings, effects)
        if not gears:
            settings.fail("[gears] is empty; write each gear as [gears.NAME]")
        model = Model(next(iter(gears.values())).gear)
    else:
        model = Model(take_gear(settings.table("gear")))
    own_soil, prior, soil_tests = take_soil(settings.table("soil"))
    simulator = None
    if "simulator" in settings:
        own = settings.table("simulator")
        if gears:
            own.fail("a simulator has one wheel, in [gear]; remove [gears]")
        simulator = take_simulator(own, model.gear)
        if with_simulator:
            gear, simulator = emulated(simulator, own_soil, prior)
            model = Model(gear)
    model, effect_priors = take_effects(settings.tables("effect"), effects, model)
    for name, other in gears.items():
        for effect in model.effects:
            if not effect.applies_to(other.gear):
                settings.fail(
                    f"the effect {effect.name} does not apply to the gear {name!r}; write it for "
                    "the others, as [[gears.NAME.effect]]"
                )
    prior |= effect_priors | gear_priors
    of_noise = settings.table("noise")
    of_noise.permit(COLUMNS)
    noise = {key: take_noise(of_noise, key) for key in COLUMNS if key in of_noise}
    of_noise.finish()
    discrepancy = take_discrepancy(settings.table("discrepancy"))
    if simulator is not None:
        simulator = replace(simulator, states_discrepancy=bool(discrepancy))
        discrepancy = with_emulator_error(discrepancy, simulator.error)
    case = Case(
        model, own_soil, prior, noise, discrepancy, gears,
        soil_tests=soil_tests, simulator=simulator,
        drive=take_declared(DriveErrors, settings.table("drive")),
    )  # fmt: skip
    if "rover" in settings:
        case = replace(case, rover=take_rover(settings.table("rover"), gears or {"": model}))
    if "remainder" in settings:
        case = replace(case, remainder=take_remainder(settings.table("remainder"), gears))
    return take_explanations(settings, effects, case)
