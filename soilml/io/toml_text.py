"""Settings as the text of a TOML file, which is read back to the last digit."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from soilml.io.cell_text import is_plain

_BARE = re.compile(r"[A-Za-z0-9_-]+")


class Inline(dict[str, Any]):
    """A table that is written on the line of its key."""


def toml_key(name: str) -> str:
    """A name as a bare key where TOML permits it, else in quotes."""
    return name if _BARE.fullmatch(name) else toml_value(name)


def toml_value(value: Any) -> str:
    """A value in TOML: numbers with all their digits, patterns in single quotes.

    Characters that are not plain are written as escapes, and half a pair of surrogates, which TOML
    does not have, as a question mark.
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        if "\\" in value and "'" not in value and is_plain(value):
            return f"'{value}'"
        written = json.dumps(value, ensure_ascii=False).encode("utf-8", "replace").decode()
        return "".join(c if is_plain(c) else f"\\U{ord(c):08x}" for c in written)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{toml_key(k)} = {toml_value(v)}" for k, v in value.items())
        return f"{{ {inner} }}"
    return str(value) if isinstance(value, int) else repr(float(value))


def toml_lines(content: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Lines of a table: its values, then the tables in it, each after a blank line.

    A dictionary is a table [path.key], a list of dictionaries is tables [[path.key]].
    """
    inner = {key: value for key, value in content.items() if _is_table(value)}
    for key in (key for key in content if key not in inner):
        yield f"{toml_key(key)} = {toml_value(content[key])}"
    for key, value in inner.items():
        own = f"{path}.{toml_key(key)}" if path else toml_key(key)
        if isinstance(value, list):
            for entry in value:
                yield from ("", f"[[{own}]]", *toml_lines(entry, own))
        else:
            named = value and all(map(_is_table, value.values()))  # a table of tables alone
            yield from (() if named else ("", f"[{own}]"))
            yield from toml_lines(value, own)


def _is_table(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(map(_is_table, value))
    return isinstance(value, dict) and not isinstance(value, Inline)
