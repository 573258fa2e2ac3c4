"""Changes of the text of a map that leave its other lines and comments as they are.

A channel is named by the path of its table: `load`, or `wheels.front_left.load`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from soilml.errors import InputError
from soilml.io.cell_text import is_number, read_number
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.channel_drafts import draft_channels
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.draft import key_line, toml_value
from soilml.log_import.mapping.channel_map import ROLES
from soilml.optional_imports import tomllib

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
_KEY = re.compile(r"\s*(#\s*)?([A-Za-z_]+)(\s*=\s*)(\"(?:[^\"\\]|\\.)*\"|'[^']*'|\[[^\]]*\]|[^#]*?)"
                  r"\s*(#.*)?$")  # fmt: skip
_MARK = re.compile(r"#[^#]*\b(?:CHANGE|NEEDED)\b[:;]?\s*(.*)$")
#: Keys of a channel that hold for whatever column it has.
_KEPT = ("bias", "noise")


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
    """The lines of a map that are marked with CHANGE or NEEDED."""
    found = []
    table, live = "", True
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table, live = header[1].strip(), True
        elif re.match(r"\s*#\s*\[[^\[\]]+\]", line):
            live = False  # what follows belongs to a table that is none yet
        mark = _MARK.search(line)
        if mark is None or number <= _head_lines(text):
            continue
        key = _KEY.match(line) if not header and live else None
        if key is not None and (key[1] is None or key[2] in ("radius", "diameter", "mass")):
            value = key[4].strip().strip("\"'")
            found.append(OpenLine(number, table, key[2], value, key[1] is not None, mark[1]))
        else:
            found.append(OpenLine(number, table, "", "", True, line.strip(" #")))
    return found


def _head_lines(text: str) -> int:
    """How many lines stand before the first blank one: what the map says of itself."""
    lines = text.splitlines()
    return next((i for i, line in enumerate(lines) if not line.strip()), 0)


def set_value(text: str, line: int, value: str) -> str:
    """The map with another value in a line `key = value`, without its mark.

    Raises `InputError` where the line sets nothing, or the map is no TOML afterwards.
    """
    lines = text.splitlines()
    match = _KEY.match(lines[line - 1]) if 0 < line <= len(lines) else None
    if match is None or not value.strip():
        raise InputError(f"map.toml line {line}: needed is a value, such as 0.15 m +- 1 %")
    given = value.strip()
    written = toml_value(read_number(given) if is_number(given) else given)
    lines[line - 1] = f"{match[2]} = {written}"
    return _checked(lines)


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


def parsed(text: str) -> dict[str, Any]:
    """The content of a map; raises `InputError` with the line where it is no TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"map.toml is no valid TOML: {error}") from None


def set_role(
    text: str, run: Run, columns: Sequence[Candidate], address: str, path: str, unit: str = ""
) -> str:
    """The map with a column in another role: its unit, sign and tare as its samples show them.

    The column leaves the channel that it was in. A channel that was another column's becomes its
    own, and keeps what it says of errors.

    run, columns: Whose samples decide, and all its columns.
    path: The channel, or "" for a column that is not used.
    unit: Unit of the column; "" for the guessed one.

    Raises `InputError` for an unknown column or channel.
    """
    chosen = next((c for c in columns if c.address == address), None)
    role = path.rpartition(".")[2]
    if chosen is None or (path and role not in ROLES):
        raise InputError(f"column {address!r}, channel {path!r}: one of them is not known")
    channels = channels_of(parsed(text))
    lines = text.splitlines()
    for other, table in channels.items():
        if other != path and address in (used := columns_in(table)):
            left = [column for column in used if column != address]
            lines = _with_columns(lines, other, left) if left else _without(lines, other)
    if not path:
        return _checked(lines)
    known = {c.address: c for c in columns}
    beside = {
        other.rpartition(".")[2]: known[used[0]]
        for other, table in channels.items()
        if other.rpartition(".")[0] == path.rpartition(".")[0]
        and (used := columns_in(table)) and used[0] in known and used[0] != address
    }  # fmt: skip
    drafted = draft_channels({**beside, role: chosen}, run, {})[role]
    if unit:
        drafted.keys.pop("scale", None)
        drafted.put("unit", unit)
        drafted.comments.pop("unit", None)
    body = [key_line(k, v, drafted.comments.get(k, "")) for k, v in drafted.keys.items()]
    kept = [key_line(k, v) for k, v in channels.get(path, {}).items() if k in _KEPT]
    start, end = _place(lines, path)
    header = lines[start] if start < end else f"[{path}]  # {ROLES[role][1]}"
    before = [] if start < end or not lines or not lines[-1].strip() else [""]
    return _checked([*lines[:start], *before, header, *body, *kept, *lines[end:]])


def set_unit(text: str, path: str, unit: str) -> str:
    """The map with another unit of a channel; raises `InputError` for one that is not there."""
    lines = text.splitlines()
    start, end = _place(lines, path)
    if start == end:
        raise InputError(f"map.toml has no [{path}]")
    kept = [line for line in lines[start:end] if (k := _KEY.match(line)) is None or k[1] or
            k[2] not in ("unit", "scale")]  # fmt: skip
    where = next((i for i, line in enumerate(kept) if re.match(r"\s*column\b", line)), 0) + 1
    kept.insert(where, key_line("unit", unit))
    return _checked([*lines[:start], *kept, *lines[end:]])


def _place(lines: Sequence[str], path: str) -> tuple[int, int]:
    """Where the table of a channel begins and ends; twice the end of the map where it is not."""
    headers = [(i, m[1].strip()) for i, line in enumerate(lines) if (m := _HEADER.match(line))]
    for (start, name), (after, _) in zip(headers, [*headers[1:], (len(lines), "")], strict=True):
        if name == path:
            keys = [(i, _KEY.match(lines[i])) for i in range(start + 1, after)]
            last = max((i for i, key in keys if key is not None and not key[1]), default=start)
            return start, last + 1
    return len(lines), len(lines)


def _without(lines: list[str], path: str) -> list[str]:
    start, end = _place(lines, path)
    while start < end < len(lines) and not lines[end].strip() and not lines[start - 1].strip():
        end += 1
    return lines[:start] + lines[end:]


def _with_columns(lines: list[str], path: str, columns: list[str]) -> list[str]:
    start, end = _place(lines, path)
    value = columns[0] if len(columns) == 1 else columns
    return [
        key_line("column", value) if start < i < end and re.match(r"\s*column\s*=", line) else line
        for i, line in enumerate(lines)
    ]


def _checked(lines: Sequence[str]) -> str:
    text = "\n".join(lines) + "\n"
    parsed(text)
    return text
