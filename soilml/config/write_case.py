"""Write a case as the text of a model file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from soilml.config.case import Case
from soilml.config.explanations import CaseExplanation, added_effects
from soilml.config.measurement_noise import discrepancy_as_settings
from soilml.config.model_settings import UNNAMED_GEAR
from soilml.config.remainder import remainder_lines
from soilml.config.wheeled_rover import DRIVE_KEYS, DriveErrors, WheeledRover
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects import Effect
from soilml.physics.gears.base import Gear
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.soils import Soil
from soilml.physics.soils.soil_tests import SoilTest


def case_as_toml(case: Case, comments: Sequence[str] = ()) -> str:
    """The case as the text of a model file, in the order in which the file is documented.

    `soilml.config.case.read_case` reads the same case back, to the last digit. Priors and noise
    are inline values, which a general TOML writer would spread over many lines, and each line of
    `comments` becomes a comment at the top.
    """
    lines = [f"# {line}" for line in comments]
    if not case.gears:
        gear = case.model.gear if case.simulator is None else case.simulator.gear
        lines += ["[gear]", *_gear_lines(gear), ""]
        if case.simulator is not None:
            lines += [*case.simulator.lines(), ""]
    for name, model in case.gears.items():
        key = name if name == UNNAMED_GEAR else f"gears.{name}"
        lines += [f"[{key}]", *_gear_lines(model.gear), ""]
        for effect in model.effects:
            lines += [*_effect_lines(case, effect, f"{key}.effect", f"{effect.name}@{name}"), ""]
    soil = {name: getattr(case.soil, name) for name in declared(Soil)}
    priors = {p: v for p, v in case.prior.items() if "." not in p}
    lines += _soil_lines(soil, priors, case.soil_tests)
    if case.noise:
        lines += ["", "[noise]"]
        lines += [f"{key} = {_setting(noise.as_setting())}" for key, noise in case.noise.items()]
    if case.bias:
        lines += ["", "[bias]"]
        lines += [f"{key} = {_setting(bias.as_setting())}" for key, bias in case.bias.items()]
    if case.discrepancy:
        lines += ["", "[discrepancy]"]
        settings = discrepancy_as_settings(case.discrepancy)
        lines += [f"{key} = {_setting(value)}" for key, value in settings.items()]
    if case.remainder is not None:
        lines += ["", *remainder_lines(case.remainder)]
    if case.rover is not None:
        lines += ["", *_rover_lines(case.rover)]
    if case.drive != DriveErrors():
        lines += ["", *_drive_lines(case.drive)]
    for effect in case.model.effects:
        lines += ["", *_effect_lines(case, effect, "effect", effect.name)]
    for one in case.explanations:
        lines += ["", *_explanation_lines(case, one)]
    return "\n".join(lines) + "\n"


def soil_as_toml(
    soil: Mapping[str, float],
    prior: Mapping[str, Prior],
    comments: Sequence[str] = (),
    tests: Sequence[SoilTest] = (),
) -> str:
    """[soil], [soil.prior] and [[soil.test]] of a model file, for some of the soil's parameters."""
    return "\n".join([f"# {line}" for line in comments] + _soil_lines(soil, prior, tests)) + "\n"


def _soil_lines(
    soil: Mapping[str, float], prior: Mapping[str, Prior], tests: Sequence[SoilTest]
) -> list[str]:
    lines = ["[soil]", *(f"{name} = {_number(value)}" for name, value in soil.items())]
    if prior:
        lines += ["", "[soil.prior]"]
        lines += [f"{name} = {_setting(p.as_setting())}" for name, p in prior.items()]
    for test in tests:
        lines += ["", "[[soil.test]]"]
        lines += [f"{key} = {_number(getattr(test, key))}" for key in declared(type(test))]
    return lines


def _gear_lines(gear: Gear) -> list[str]:
    """Type and dimensions of a gear."""
    dimensions = [f"{k} = {_number(getattr(gear, k))}" for k in declared(type(gear))]
    braking = getattr(gear, "braking", RigidWheel.braking)
    law = [f'braking = "{braking}"'] if braking != RigidWheel.braking else []
    return [f'type = "{gear.name}"', *dimensions, *law]


def _drive_lines(drive: DriveErrors) -> list[str]:
    values = {DRIVE_KEYS[name]: value for name, value in vars(drive).items() if value is not None}
    return ["[drive]", *(f"{key} = {_number(value)}" for key, value in values.items())]


def _rover_lines(rover: WheeledRover) -> list[str]:
    lines = ["[rover]", f"mass = {_number(rover.mass)}"]
    lines += [f"centre_of_mass = {_setting(list(rover.centre_of_mass))}"]
    lines += [f"gravity = {_number(rover.gravity)}", "", "[rover.wheels]"]
    for name, wheel in rover.wheels.items():
        own = {"position": [wheel.forward, wheel.left]}
        lines.append(
            f"{_key(name)} = {_setting(own | ({'gear': wheel.gear} if wheel.gear else {}))}"
        )
    return lines


def _key(name: str) -> str:
    """A name as a bare key where TOML permits it, else in quotes."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _explanation_lines(case: Case, one: CaseExplanation) -> list[str]:
    """What an explanation has beside the case: its weight, soil, priors of the soil, effects."""
    lines = ["[[explanation]]", f"weight = {_number(one.weight)}", "[explanation.soil]"]
    for name in declared(Soil):
        if float(getattr(one.soil, name)) != float(getattr(case.soil, name)):
            lines.append(f"{name} = {_number(getattr(one.soil, name))}")
    soil = {p: v for p, v in one.prior.items() if "." not in p and case.prior.get(p) != v}
    if soil:
        lines.append("[explanation.prior]")
        lines += [f"{name} = {_setting(prior.as_setting())}" for name, prior in soil.items()]
    own = case.of_explanation(one)
    for path, effect in added_effects(case, one).items():
        lines += _effect_lines(own, effect, "explanation.effect", path)
    return lines


def _effect_lines(case: Case, effect: Effect, table: str, path: str) -> list[str]:
    """An effect with its priors, which are those below `path`."""
    lines, default = [f"[[{table}]]", f'name = "{effect.name}"'], type(effect)()
    if table.startswith("explanation") and "@" in path:
        lines.append(f'gear = "{path.partition("@")[2]}"')
    for key in declared(type(effect)):
        if float(getattr(effect, key)) != float(getattr(default, key)):
            lines.append(f"{key} = {_number(getattr(effect, key))}")
    priors = {p: v for p, v in case.prior.items() if p.startswith(f"{path}.")}
    if priors:
        lines.append(f"[{table}.prior]")
        for name, prior in priors.items():
            lines.append(f"{name.rpartition('.')[2]} = {_setting(prior.as_setting())}")
    return lines


def _number(value: object) -> str:
    text = repr(float(value))  # type: ignore[arg-type]
    return text if any(c in text for c in ".en") else f"{text}.0"


def _setting(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        inner = ", ".join(f"{k} = {_setting(v)}" for k, v in value.items())
        return "{ " + inner + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_number(v) for v in value) + "]"
    return _number(value)
