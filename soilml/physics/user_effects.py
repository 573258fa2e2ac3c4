"""Effects of a user's own, from a Python file of theirs."""

from __future__ import annotations

import os
import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from soilml.errors import InputError
from soilml.parameters import check, declared
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.base import KINDS, STAGES, Effect
from soilml.physics.operating_point import COVARIATES


def load_effects(path: str | os.PathLike[str]) -> dict[str, type[Effect]]:
    """Run a Python file and return the effects that it defines, by name.

    An effect is a class derived from `soilml.Effect` with at least one stage, declared by
    `soilml.effect`. Classes whose names begin with an underscore are ignored. The file may do all
    that Python may: load only what you would run.

    path: The Python file.

    Returns: Effect class by name, in order of definition.

    Raises `InputError`: One line, for a file that does not run and for a class that is not a valid
    effect.
    """
    module = _run(Path(path))
    effects: dict[str, type[Effect]] = {}
    for cls in _candidates(module):
        where = f"{path}: {cls.__name__}"
        if fault := _fault(cls):
            raise InputError(f"{where}: {fault}")
        if cls.name in EFFECTS:
            raise InputError(f"{where}: the catalogue has an effect {cls.name!r} already")
        if cls.name in effects:
            raise InputError(f"{where}: {effects[cls.name].__name__} is {cls.name!r} already")
        effects[cls.name] = cls
    if not effects:
        raise InputError(
            f"{path}: no effect in it; one is a class under @effect(NAME, ...) with one of: "
            f"{', '.join(STAGES)}"
        )
    return effects


def _run(path: Path) -> ModuleType:
    """The file as a module."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    spec = spec_from_file_location(f"own_effects_{path.stem}", path)
    if spec is None:
        raise InputError(f"{path}: its name must end in .py")
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # where the types of dataclass fields are looked up
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    except SyntaxError as error:
        raise InputError(f"{path}: line {error.lineno}: {error.msg}") from error
    except InputError as error:  # from `Effect.__init_subclass__`, a message for the user
        raise InputError(f"{path}: {error}") from error
    except (Exception, SystemExit) as error:
        message = " ".join(str(error).split())
        raise InputError(f"{path}: {type(error).__name__} when run: {message}") from error
    return module


def _candidates(module: ModuleType) -> list[Any]:
    """The classes of a file that are meant to be effects, in order of definition."""
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__
    ]
    return [v for v in own if v.__name__[0] != "_" and any(hasattr(v, name) for name in STAGES)]


def _fault(cls: Any) -> str:
    """What keeps a class from being an effect; empty where it is one."""
    if not issubclass(cls, Effect):
        return f"derive it from soilml.Effect: class {cls.__name__}(Effect)"
    if "about" not in vars(cls):
        return "declare it: write @effect(NAME, ...) above the class"
    if not any(cls.overrides(name) for name in STAGES):
        return f"it acts on nothing; it needs one of the methods {', '.join(STAGES)}"
    name, about = cls.name, cls.about
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        return f"name is {name!r}; it takes lower-case letters, digits and hyphens"
    if about.kind not in KINDS:
        return f"kind is {about.kind!r}; there are: {', '.join(KINDS)}"
    if unknown := [need for need in (*about.needs, *about.uses) if need not in COVARIATES]:
        return f"needs or uses has {unknown[0]!r}; there are: {', '.join(COVARIATES)}"
    try:
        parameters, neutral = declared(cls), cls()
    except (NameError, TypeError) as error:
        return f"its fields need types that exist and neutral defaults: {error}"
    if not about.reference:
        return "reference is empty; its first key is the parameter that is the effect's size"
    if unknown := [key for key in about.reference if key not in parameters]:
        there = ", ".join(parameters) or "none, they are fields: Annotated[Real, Parameter(...)]"
        return f"reference has {unknown[0]!r}; its parameters are: {there}"
    try:
        check(neutral)
        check(cls(**about.reference), "reference ")
    except InputError as error:
        return str(error)
    return ""
