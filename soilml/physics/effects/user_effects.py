"""Effects of a user's own, from a Python file of theirs."""

from __future__ import annotations

import os
import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from soilml.errors import InputError
from soilml.parameters import check, declared
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.base import KINDS, STAGES, EffectCard
from soilml.physics.operating_point import COVARIATES


def load_effects(path: str | os.PathLike[str]) -> dict[str, type]:
    """Run a Python file and return the effects that it defines, by name.

    An effect is a frozen dataclass with a `name`, a card `about` and at least one stage of
    `soilml.physics.effects.base.STAGES`, as those of the catalogue are; classes whose names begin
    with an underscore are left alone. The file may do all that Python may: load what you would
    run. Raises `InputError`, one line, for a file that does not run and an effect that no model
    could take.
    """
    found: dict[str, type] = {}
    for cls in _classes(Path(path)):
        where = f"{path}: {cls.__name__}"
        if fault := _fault(cls):
            raise InputError(f"{where}: {fault}")
        if cls.name in EFFECTS:
            raise InputError(f"{where}: the catalogue has an effect {cls.name!r} already")
        if cls.name in found:
            raise InputError(f"{where}: {found[cls.name].__name__} is {cls.name!r} already")
        found[cls.name] = cls
    if not found:
        raise InputError(
            f"{path}: no effect in it; one is a frozen dataclass with name, about and one of: "
            f"{', '.join(STAGES)}"
        )
    return found


def _classes(path: Path) -> list[Any]:
    """The classes of a file that mean to be effects, in order of definition."""
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
    except (Exception, SystemExit) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{path}: {type(error).__name__} when run: {said}") from error
    own = [v for v in vars(module).values() if isinstance(v, type) and v.__module__ == spec.name]
    acts = ("about", *STAGES)
    return [v for v in own if v.__name__[0] != "_" and any(hasattr(v, name) for name in acts)]


def _fault(cls: Any) -> str:
    """What keeps a class from being an effect; nothing where it is one."""
    made = vars(cls).get("__dataclass_params__")  # its own, not that of what it derives from
    if made is None or not made.frozen:
        return "an effect is decorated by @dataclass(frozen=True, kw_only=True)"
    if not any(hasattr(cls, stage) for stage in STAGES):
        return f"it acts on nothing; it needs one of the methods {', '.join(STAGES)}"
    if not isinstance(getattr(cls, "name", None), str):
        return 'name is missing; write name: ClassVar[str] = "my-effect"'
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", cls.name):
        return f"name is {cls.name!r}; it takes lower-case letters, digits and hyphens"
    about = getattr(cls, "about", None)
    if not isinstance(about, EffectCard):
        return "about is missing; it is a soilml.physics.effects.EffectCard"
    if about.kind not in KINDS:
        return f"about.kind is {about.kind!r}; there are: {', '.join(KINDS)}"
    if unknown := [need for need in about.needs if need not in COVARIATES]:
        return f"about.needs has {unknown[0]!r}; there are: {', '.join(COVARIATES)}"
    return _fault_of_size(cls, about)


def _fault_of_size(cls: Any, about: EffectCard) -> str:
    """What is wrong with the parameters of an effect, or nothing."""
    try:
        parameters = declared(cls)
        neutral = cls()
    except (NameError, TypeError) as error:
        return f"its fields need types that exist and neutral defaults: {error}"
    if not about.reference:
        return "about.reference is empty; its first key is the parameter that is the effect's size"
    if unknown := [key for key in about.reference if key not in parameters]:
        there = ", ".join(parameters) or "none, they are fields: Annotated[Real, Parameter(...)]"
        return f"about.reference has {unknown[0]!r}; its parameters are: {there}"
    try:
        check(neutral)
        check(cls(**about.reference), "about.reference ")
    except InputError as error:
        return str(error)
    return ""
