"""TOML settings, read key by key; every error names file, table and key."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from soilml.errors import InputError
from soilml.io.atomic_files import refuse_device
from soilml.io.bounds import SETTINGS
from soilml.optional_imports import tomllib

#: Tables and lists in one another that a settings file may have; none needs more than six.
MOST_DEPTH = 20
#: A dotted key of more parts, bare or in quotes: time and memory of the parser grow with the square
#: of the parts.
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MOST_DEPTH},}}[ \t]*[\]=]")


class Settings:
    """One table of a TOML file; each key is taken once, and `finish` rejects the others.

    `folder` is that of a file that its user gave on the command line: it may name any file, and one
    without a folder is beside it. A text of other origin, such as a page, an upload or the metadata
    of a file, has None and may name none.
    """

    def __init__(self, content: dict[str, Any], where: str, folder: Path | None = None) -> None:
        self.content = content
        self._remaining = dict(content)
        self._all = tuple(content)
        self.where = where
        self.folder = folder
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        return key in self._remaining

    def take(
        self, key: str, kind: type | tuple[type, ...], needed: str, default: Any = None
    ) -> Any:
        """The value of `key`, required without a default; `needed` describes it in messages."""
        self._known.append(key)
        if key not in self._remaining:
            if default is None:
                near = difflib.get_close_matches(key, self._remaining, 1, 0.6)
                hint = f" (did you misspell it as {near[0]!r}?)" if near else ""
                self.fail(f"{key} is missing{hint}; needed is {needed}")
            return default
        value = self._remaining.pop(key)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            self.fail(f"{key} is {value!r}; needed is {needed}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """A number."""
        return float(self.take(key, (int, float), "a number", default))

    def count(self, key: str, default: int | None = None) -> int:
        """A whole number, 1 or more."""
        value = self.take(key, int, "a whole number, 1 or more", default)
        if value < 1:
            self.fail(f"{key} is {value}; needed is a whole number, 1 or more")
        return int(value)

    def text(self, key: str, default: str | None = None) -> str:
        """A text."""
        return str(self.take(key, str, "a text in quotes", default))

    def file(self, key: str) -> Path:
        """The path of a file, which may not exist; `InputError` where these may name none."""
        name = self.text(key)
        if self.folder is None:
            self.fail(
                f"{key} is {name!r}; a text from the page, from an upload or from metadata may "
                "name no file: use the command line for it"
            )
        return self.folder / name

    def table(self, key: str) -> Settings:
        """The table [key]; an empty one where there is none."""
        content = self.take(key, dict, f"a table [{key}]", {})
        nested = self.where.endswith("]") and not self.where.endswith("]]")
        where = f"{self.where[:-1]}.{key}]" if nested else f"{self.where} [{key}]"
        return Settings(content, where, self.folder)

    def tables(self, key: str) -> list[Settings]:
        """The tables [[key]], in order."""
        content = self.take(key, list, f"tables [[{key}]]", [])
        if not all(isinstance(entry, dict) for entry in content):
            self.fail(f"{key} must be written as tables: [[{key}]]")
        return [
            Settings(entry, f"{self.where} [[{key}]] number {i}", self.folder)
            for i, entry in enumerate(content, 1)
        ]

    def permit(self, keys: Iterable[str]) -> None:
        """Add permitted keys, which the message about an unknown key suggests."""
        self._known.extend(keys)

    def finish(self) -> None:
        """Raise `InputError` for the first key that was not taken."""
        for key in self._remaining:
            near = difflib.get_close_matches(key, self._known, 1, 0.6)
            known = ", ".join(dict.fromkeys(self._known))
            hint = f"did you mean {near[0]!r}?" if near else f"known: {known}"
            self.fail(f"unknown key {key!r}; {hint}")

    def fail(self, text: str) -> NoReturn:
        """Raise `InputError` with file and table before the text."""
        raise InputError(f"{self.where}: {text}")


def read_settings(
    path: str | os.PathLike[str], write: str = "", names_files: bool = True
) -> Settings:
    """The TOML file at `path`; raises `InputError` where it is missing or not valid TOML.

    `write` is the command that writes a first one, for the message; `names_files`, whether it may
    name others.
    """
    file = Path(path)
    try:
        refuse_device(file)
        with file.open(encoding="utf-8-sig") as opened:  # which may be a pipe, of any length
            text = opened.read(SETTINGS.most + 1)
        SETTINGS.check(file, len(text))
        if _LONG_KEY.search(text):
            raise InputError(
                f"{file} is not valid, nested too deep: a key has more than {MOST_DEPTH} parts"
            )
        content = tomllib.loads(text)
        _check_values(content, str(file))
    except FileNotFoundError:
        hint = f"; `{write}` writes one" if write else ""
        raise InputError(f"{file}: there is no such file{hint}") from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file} cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is not valid TOML: {error}") from None
    except InputError:
        raise
    except ValueError:  # more digits than Python turns into a number
        raise InputError(f"{file} is not valid TOML: a number has thousands of digits") from None
    except RecursionError:
        raise InputError(f"{file} is not valid TOML: tables or lists are nested too deep") from None
    return Settings(content, str(file), file.parent if names_files else None)


def _check_values(content: Any, where: str, depth: int = 0) -> None:
    """Raise `InputError` for tables or lists in more than `MOST_DEPTH` others, and for a whole
    number of more than the 64 bits that TOML allows.
    """
    if depth > MOST_DEPTH:
        raise InputError(f"{where} is not valid: tables or lists are nested too deep")
    if isinstance(content, dict):
        for name, value in content.items():
            _check_values(value, f"{where} {name}" if depth < 2 else where, depth + 1)
    elif isinstance(content, list):
        for value in content:
            _check_values(value, where, depth + 1)
    elif isinstance(content, int) and not -(2**63) <= content < 2**63:
        raise InputError(f"{where}: the whole number has more than the 64 bits of TOML")
