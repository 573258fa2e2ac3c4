"""soilml estimates the strength of the soil that a rover drives on.

The names below are loaded on first use, so that the runtime on board loads only what it needs.
Effects of the catalogue (`soilml.physics.effects`) can be imported from here too.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module

TYPE_CHECKING = False  # typing takes longer to import than all this; type checkers read it as true
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.3.0"


@cache
def _home() -> dict[str, str]:
    """The module that defines each public name, as the stub beside this file states."""
    import re
    from pathlib import Path

    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    found = re.findall(r"^from (\S+) import (\w+) as \w+$", stub, re.MULTILINE)
    return {name: module for module, name in found}


def __getattr__(name: str) -> Any:
    if name.startswith("_") and name != "__all__":
        raise AttributeError(f"soilml has no {name!r}")
    home = _home()
    if name in home:
        return getattr(import_module(home[name]), name)
    if name == "__all__":
        return ["__version__", *home, *_effects()]
    if name in _effects():
        return _effects()[name]
    raise AttributeError(f"soilml has no {name!r}")


def __dir__() -> list[str]:
    return sorted(__getattr__("__all__"))


def _effects() -> dict[str, Any]:
    """The catalogue of effects, what is needed to write one, and its effects by class name."""
    module = import_module("soilml.physics.effects")
    names = ("EFFECTS", "Effect", "EffectCard", "effect")
    catalogue = {effect.__name__: effect for effect in module.EFFECTS.values()}
    return {name: getattr(module, name) for name in names} | catalogue
