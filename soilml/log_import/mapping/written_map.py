"""A map that is written: tables of keys with a reason for each, as TOML with comments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from soilml.io.cell_text import one_line
from soilml.io.toml_text import toml_value


class Marked(str):
    """A line of a map, or the comment of a key, with what no log shows: a person must look."""


def key_line(key: str, value: Any, comment: str = "") -> str:
    """The line of a key, which is marked where its comment is."""
    line = f"{key} = {toml_value(value)}" + (f"  # {comment}" if comment else "")
    return Marked(line) if isinstance(comment, Marked) else line


@dataclass
class WrittenTable:
    """A table: its keys, a comment for each, and lines of comment before and after them.

    The path of a channel is `load`, or `wheels.front_left.load`. A table without a path is comments
    alone, such as what is needed.
    """

    path: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    about: str = ""  # Comment behind the path
    before: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)

    def put(self, key: str, value: Any, why: str = "") -> None:
        """Set a key and its comment."""
        whole = isinstance(value, float) and value.is_integer()
        self.keys[key] = int(value) if whole else value
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
    """A map as its tables in order, below lines of comment on the logs; what speaks for it."""

    head: list[str]
    tables: list[WrittenTable]
    evidence: str

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
