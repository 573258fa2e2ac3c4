"""A map that is written: tables of keys with a reason for each, as TOML; and changes of its text.

A channel is named by the path of its table: `load`, or `wheels.front_left.load`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from soilml.errors import InputError
from soilml.io.cell_text import is_number, is_plain, one_line, read_number
from soilml.log_import.mapping.channel_map import ROLES
from soilml.optional_imports import need, tomllib

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
_KEY = re.compile(r"\s*(#\s*)?([A-Za-z_]+)(\s*=\s*)(\"(?:[^\"\\]|\\.)*\"|'[^']*'|\[[^\]]*\]|[^#]*?)"
                  r"\s*(#.*)?$")  # fmt: skip
_MARK = re.compile(r"#[^#]*\b(?:CHANGE|NEEDED)\b[:;]?\s*(.*)$")
_UNSET = ("radius", "diameter", "mass")  # Keys that may stand in a comment, to be filled in
#: Keys of a channel that hold for whatever column it has.
_KEPT = ("bias", "noise")


class Marked(str):
    """A line of a map, or the comment of a key, with what no log shows: a person must look."""


def toml_value(value: Any) -> str:
    """A value in TOML: numbers without needless digits, patterns in single quotes.

    Characters that are not plain are written as escapes, and half a pair of surrogates, which TOML
    does not have, as a question mark.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int | np.number):
        return f"{float(value):g}" if float(value) != int(value) else f"{int(value)}"
    if isinstance(value, str) and "\\" in value and "'" not in value and is_plain(value):
        return f"'{value}'"
    written = json.dumps(value, ensure_ascii=False).encode("utf-8", "replace").decode()
    return "".join(c if is_plain(c) else f"\\U{ord(c):08x}" for c in written)


def key_line(key: str, value: Any, comment: str = "") -> str:
    """The line of a key, which is marked where its comment is."""
    line = f"{key} = {toml_value(value)}" + (f"  # {comment}" if comment else "")
    return Marked(line) if isinstance(comment, Marked) else line


@dataclass
class WrittenTable:
    """A table: its keys, a comment for each, and lines of comment before and after them.

    A table without a path is comments alone, such as what is needed.
    """

    path: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    about: str = ""  # Comment behind the path
    before: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)

    def put(self, key: str, value: Any, why: str = "") -> None:
        """Set a key and its comment."""
        self.keys[key] = value
        if why:
            self.comments[key] = why

    @property
    def is_marked(self) -> bool:
        """Whether a key says that a person must look."""
        return any(isinstance(why, Marked) for why in self.comments.values())

    def lines(self) -> Iterator[str]:
        """The lines of TOML after a blank one."""
        yield from ("", *self.before)
        if self.path:
            yield f"[{self.path}]" + (f"  # {self.about}" if self.about else "")
            for key, value in self.keys.items():
                yield key_line(key, value, self.comments.get(key, ""))
        yield from self.after


@dataclass
class WrittenMap:
    """A map as its tables in order, below lines of comment on the logs."""

    head: list[str]
    tables: list[WrittenTable]

    @property
    def content(self) -> dict[str, Any]:
        """What the text holds, as nested dictionaries."""
        return tomllib.loads(self.text)

    @property
    def text(self) -> str:
        """The map in TOML; names and lines of the log also stand in comments, as one line each."""
        return "\n".join(map(one_line, self._lines())) + "\n"

    @property
    def marked(self) -> int:
        """How many lines say that a person must look."""
        return sum(isinstance(line, Marked) for line in self._lines())

    def _lines(self) -> list[str]:
        return [*self.head, *(line for table in self.tables for line in table.lines())]


@dataclass(frozen=True)
class OpenLine:
    """A line of a map that a person must look at.

    line: Its number, from 1.
    table, key: What it sets; "" for a line that sets nothing.
    value: As it is written, without quotes.
    unset: Whether the line is a comment, which `set_value` makes a setting.
    why: What is to be looked at.
    """

    line: int
    table: str
    key: str
    value: str
    unset: bool
    why: str


def open_lines(text: str) -> list[OpenLine]:
    """The lines of a map that are marked with CHANGE or NEEDED, below what it says of itself."""
    lines = text.splitlines()
    head = next((i for i, line in enumerate(lines) if not line.strip()), 0)
    found, table, live = [], "", True
    for number, line in enumerate(lines, 1):
        if header := _HEADER.match(line):
            table, live = header[1].strip(), True
        elif re.match(r"\s*#\s*\[[^\[\]]+\]", line):
            live = False  # what follows belongs to a table that is none yet
        mark = _MARK.search(line)
        if mark is None or number <= head:
            continue
        key = _KEY.match(line) if not header and live else None
        if key is not None and (key[1] is None or key[2] in _UNSET):
            value = key[4].strip().strip("\"'")
            found.append(OpenLine(number, table, key[2], value, key[1] is not None, mark[1]))
        else:
            found.append(OpenLine(number, table, "", "", True, line.strip(" #")))
    return found


def set_value(text: str, line: int, value: str) -> str:
    """The map with another value in a line `key = value`, without its mark.

    Raises `InputError` where the line sets nothing, or the map is no TOML afterwards.
    """
    lines = text.splitlines()
    match = _KEY.match(lines[line - 1]) if 0 < line <= len(lines) else None
    given = value.strip()
    if match is None or not given:
        raise InputError(f"map.toml line {line}: needed is a value, such as 0.15 m +- 1 %")
    lines[line - 1] = key_line(match[2], read_number(given) if is_number(given) else given)
    changed = "\n".join(lines) + "\n"
    parsed(changed)
    return changed


def parsed(text: str) -> dict[str, Any]:
    """The content of a map; raises `InputError` with the line where it is no TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"map.toml is no valid TOML: {error}") from None


def channels_of(content: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The tables of the channels of a map by path, a wheel's own without the keys it shares."""
    found = {role: content[role] for role in ROLES if isinstance(content.get(role), dict)}
    wheels = content.get("wheels", {})
    for name, own in wheels.items() if isinstance(wheels, dict) else ():
        if isinstance(own, dict):
            found |= {f"wheels.{name}.{r}": own[r] for r in ROLES if isinstance(own.get(r), dict)}
    return found


def columns_in(table: Mapping[str, Any]) -> list[str]:
    """The columns of the table of a channel."""
    column = table.get("column", [])
    return [column] if isinstance(column, str) else [c for c in column if isinstance(c, str)]


def with_channel(text: str, column: str, drafted: WrittenTable | None) -> str:
    """The map in which a column has a channel, or none; all other lines stay as they are.

    The column leaves the channels that it was in. A channel that was another column's becomes its
    own, and keeps what it says of errors.
    """
    document = _document(text)
    for path, table in channels_of(document).items():
        left = [own for own in columns_in(table) if own != column]
        if len(left) == len(columns_in(table)) or (drafted and path == drafted.path):
            continue
        if left:
            table["column"] = left[0] if len(left) == 1 else left
        else:
            parent, role = _parent(document, path)
            del parent[role]
    if drafted is not None:
        parent, role = _parent(document, drafted.path)
        old = parent.get(role, {})
        kept = {key: old[key] for key in _KEPT if key in old}
        new = _document("\n".join([*drafted.lines(), *(key_line(k, v) for k, v in kept.items())]))
        for name in drafted.path.split(".")[:-1]:
            new = new[name]
        parent[role] = new[role]
    return str(document.as_string())


def with_unit(text: str, path: str, unit: str) -> str:
    """The map with another unit of a channel; raises `InputError` for one that is not there."""
    document = _document(text)
    table = channels_of(document).get(path)
    if table is None:
        raise InputError(f"map.toml has no [{path}]")
    table.pop("scale", None)
    table["unit"] = unit
    table["unit"].trivia.comment = table["unit"].trivia.comment_ws = ""
    return str(document.as_string())


def _document(text: str) -> Any:
    need("tomlkit", "", "logs", what="changing a map")
    import tomlkit

    parsed(text)
    return tomlkit.parse(text)


def _parent(document: Any, path: str) -> tuple[Any, str]:
    """The table that holds a path, and the last name of the path."""
    *parents, role = path.split(".")
    for name in parents:
        document = document[name]
    return document, role
