"""Write a case as the text of a model file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from soilml.config.case import Case
from soilml.config.explanations import CaseExplanation, added_effects
from soilml.config.measurement_noise import discrepancy_as_settings
from soilml.config.model_settings import UNNAMED_GEAR
from soilml.config.wheeled_rover import DriveErrors, WheeledRover
from soilml.io.declared_settings import settings_of
from soilml.io.toml_text import Inline, toml_lines
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects import Effect
from soilml.physics.gears.base import Gear
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.soils import Soil
from soilml.physics.soils.soil_tests import SoilTest

Content = dict[str, Any]


def case_as_toml(case: Case, comments: Sequence[str] = ()) -> str:
    """The case as the text of a model file, in the order in which the file is documented.

    `soilml.config.case.read_case` reads the same case back, to the last digit. Each line of
    `comments` becomes a comment at the top.
    """
    content: Content = {}
    if not case.gears:
        gear = case.model.gear if case.simulator is None else case.simulator.gear
        content["gear"] = _gear(gear)
        if case.simulator is not None:
            content["simulator"] = case.simulator.as_settings()
    for name, model in case.gears.items():
        own = _gear(model.gear)
        if model.effects:
            own["effect"] = [_effect(case, e, f"{e.name}@{name}") for e in model.effects]
        holder = content if name == UNNAMED_GEAR else content.setdefault("gears", {})
        holder[name] = own
    soil = {name: getattr(case.soil, name) for name in declared(Soil)}
    priors = {p: v for p, v in case.prior.items() if "." not in p}
    content["soil"] = _soil(soil, priors, case.soil_tests)
    content["noise"] = {key: noise.as_setting() for key, noise in case.noise.items()}
    content["bias"] = {key: bias.as_setting() for key, bias in case.bias.items()}
    content["discrepancy"] = discrepancy_as_settings(case.discrepancy)
    if case.remainder is not None:
        content["remainder"] = case.remainder.as_settings()
    if case.rover is not None:
        content["rover"] = _rover(case.rover)
    if case.drive != DriveErrors():
        content["drive"] = settings_of(case.drive)
    content["effect"] = [_effect(case, effect, effect.name) for effect in case.model.effects]
    content["explanation"] = [_explanation(case, one) for one in case.explanations]
    return _text({key: value for key, value in content.items() if value}, comments)


def soil_as_toml(
    soil: Mapping[str, float],
    prior: Mapping[str, Prior],
    comments: Sequence[str] = (),
    tests: Sequence[SoilTest] = (),
) -> str:
    """[soil], [soil.prior] and [[soil.test]] of a model file, for some of the soil's parameters."""
    return _text({"soil": _soil(soil, prior, tests)}, comments)


def _text(content: Content, comments: Sequence[str]) -> str:
    lines = [*toml_lines(content)][1:]  # without the blank line before the first table
    return "\n".join([*(f"# {line}" for line in comments), *lines]) + "\n"


def _soil(
    soil: Mapping[str, float], prior: Mapping[str, Prior], tests: Sequence[SoilTest]
) -> Content:
    own = {name: float(value) for name, value in soil.items()} | _priors(prior)
    return own | ({"test": [settings_of(test) for test in tests]} if tests else {})


def _priors(prior: Mapping[str, Prior]) -> Content:
    """The table of priors by the last part of their paths; none where there is no prior."""
    own = {path.rpartition(".")[2]: p.as_setting() for path, p in prior.items()}
    own = {name: Inline(p) if isinstance(p, dict) else p for name, p in own.items()}
    return {"prior": own} if own else {}


def _gear(gear: Gear) -> Content:
    """Type and dimensions of a gear."""
    own: Content = {"type": gear.name}
    own |= {key: float(getattr(gear, key)) for key in declared(type(gear))}
    braking = getattr(gear, "braking", RigidWheel.braking)
    return own | ({"braking": braking} if braking != RigidWheel.braking else {})


def _rover(rover: WheeledRover) -> Content:
    wheels = {
        name: Inline(position=[w.forward, w.left], **({"gear": w.gear} if w.gear else {}))
        for name, w in rover.wheels.items()
    }
    return settings_of(rover) | {"wheels": wheels}


def _explanation(case: Case, one: CaseExplanation) -> Content:
    """What an explanation has beside the case: its weight, soil, priors of the soil, effects."""
    soil = {
        name: float(getattr(one.soil, name)) for name in declared(Soil)
        if float(getattr(one.soil, name)) != float(getattr(case.soil, name))
    }  # fmt: skip
    priors = {p: v for p, v in one.prior.items() if "." not in p and case.prior.get(p) != v}
    own, added = case.of_explanation(one), added_effects(case, one)
    effects = []
    for path, effect in added.items():
        _, _, gear = path.partition("@")
        effects.append({**({"gear": gear} if gear else {}), **_effect(own, effect, path)})
    found = {"weight": float(one.weight), "soil": soil} | _priors(priors)
    return found | ({"effect": effects} if effects else {})


def _effect(case: Case, effect: Effect, path: str) -> Content:
    """An effect with its values that are not usual, and its priors, which are below `path`."""
    values = {key: float(getattr(effect, key)) for key in declared(type(effect))}
    usual = type(effect)()
    own = {k: v for k, v in values.items() if v != float(getattr(usual, k))}
    priors = {p: v for p, v in case.prior.items() if p.startswith(f"{path}.")}
    return {"name": effect.name} | own | _priors(priors)
