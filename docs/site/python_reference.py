"""Signatures without the machinery of annotations, and the parameters that a class declares."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

from sphinx.application import Sphinx

from soilml.parameters import declared

_PARAMETER = re.compile(r"(?:~?[\w.]*\.)?Annotated\[(.*?), ~?[\w.]*Parameter\(.*?\)\]")
_COLON = "\ue000"  # a character that no docstring has
_ARRAY = re.compile(r"float \| ~?[\w.]*NumericArray")


def _short(signature: str | None) -> str | None:
    """The signature with `Annotated[float | NumericArray, Parameter(...)]` as `float | Array`."""
    if signature is None:
        return None
    text = _PARAMETER.sub(r"\1", signature)
    text = _ARRAY.sub("float | Array", text)
    return re.sub(r"~?numpy\.ndarray\[[^\]]*\[[^\]]*\]\]", "ndarray", text)


def _signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, given: str | None, back: str | None
) -> tuple[str | None, str | None]:
    return _short(given), _short(back)


def _parameters(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Add unit, bounds and meaning of each declared parameter."""
    if what != "class" or not dataclasses.is_dataclass(obj):
        return
    # types that are imported for type checkers alone cannot be resolved: only these have to be
    if not any("Parameter(" in str(field.type) for field in dataclasses.fields(obj)):
        return
    found = declared(obj)
    lines += ["", ".. rubric:: Declared parameters", ""]
    for field, parameter in found.items():
        unit = "" if parameter.unit in ("1", "-") else f" {parameter.unit}"
        text = parameter.text.replace("|", r"\|").replace("*", r"\*")
        lines.append(
            f"- ``{field}``: {text}; from {parameter.lower:g} to {parameter.upper:g}{unit}"
        )
    lines.append("")


def _before_napoleon(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Hide colons of comments on attributes, before which napoleon expects a type.

    Docstrings of modules are for those who change them; the pages have introductions of their own.
    """
    if what == "module":
        lines.clear()
    if what in ("attribute", "property"):
        lines[:] = [line.replace(": ", _COLON) for line in lines]


def _after_napoleon(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Bring the colons back."""
    lines[:] = [line.replace(_COLON, ": ") for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hooks of autodoc."""
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-process-docstring", _parameters)
    app.connect("autodoc-process-docstring", _before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=600)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
