"""The messages that soilml raises, read from its sources and listed on the page of error messages.

The page groups them by the modules in its comments `<!-- messages: PATTERN ... -->`. Every module
that raises belongs to one group: `python docs/site/error_listing.py` fails, and so does a test,
where a module is in none or in several, or a pattern fits no module.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/reference/errors.md"
PACKAGES = ("soilml", "datagen", "training")
#: What users meet; ValueError and others are turned into one of these before they leave soilml.
RAISED = (
    "SoilmlError",
    "InputError",
    "TableError",
    "FitError",
    "ModelFileError",
    "MissingLibraryError",
    "argparse.ArgumentTypeError",
)
#: Hints at a wrong map are yielded as remarks, and become part of one message.
HINTS = "soilml/log_import/checks/"
_GROUP = re.compile(r"<!-- messages: (.*?) -->", re.DOTALL)


@dataclass(frozen=True)
class Message:
    """A message with `…` in the place of values, its class and its module."""

    module: str
    error: str
    text: str


def messages() -> Iterator[Message]:
    """All messages, by module and line."""
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            yield from _of(file.read_text(), str(file.relative_to(ROOT)))


def _of(source: str, module: str) -> Iterator[Message]:
    """The messages in the source of one module."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            name = ast.unparse(node.exc.func)
            if name in RAISED and node.exc.args:
                yield Message(module, name, _text(node.exc.args[0]))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "fail" and node.args:
            yield Message(module, "SoilmlError", _text(node.args[0]))
        elif (
            isinstance(node, ast.Yield)
            and isinstance(node.value, ast.Call)
            and module.startswith(HINTS)
        ):
            yield Message(module, "InputError", _text(node.value.args[1]))


def _text(node: ast.expr) -> str:
    """A string expression with `…` for what is filled in."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left) + _text(node.right)
    return "…"


def groups(page: str) -> list[tuple[str, ...]]:
    """The patterns of each group of the page, in order."""
    return [tuple(match[1].split()) for match in _GROUP.finditer(page)]


def faults(page: str, found: list[Message]) -> list[str]:
    """What is wrong with the page, in words; empty where every message is in one group."""
    known = groups(page)
    modules = sorted({message.module for message in found})
    wrong = []
    for module in modules:
        number = sum(any(fnmatch(module, one) for one in patterns) for patterns in known)
        if number != 1:
            where = "no group" if number == 0 else f"{number} groups"
            wrong.append(f"{module} raises messages and is in {where} of {PAGE.name}")
    for pattern in (one for patterns in known for one in patterns):
        if not any(fnmatch(module, pattern) for module in modules):
            wrong.append(f"the pattern {pattern} of {PAGE.name} fits no module that raises")
    return wrong


def _listing(patterns: tuple[str, ...], found: list[Message]) -> str:
    """The messages of one group as a folded list in MyST."""
    lines = []
    for message in found:
        worded = len(re.findall(r"[A-Za-z]{2,}", message.text)) >= 2
        if worded and any(fnmatch(message.module, one) for one in patterns):
            text = message.text.replace("`", "'").replace("\n", " ").strip()
            lines.append(f"- `{text}`")
    lines = list(dict.fromkeys(lines))
    if not lines:
        return ""
    head = f":::{{dropdown}} {len(lines)} message{'s' if len(lines) > 1 else ''}"
    return "\n".join([head, "", "In the words of the sources:", "", *lines, ":::"])


def _insert(app: Any, docname: str, source: list[str]) -> None:
    """Replace the comments of the page by the listings."""
    if f"{docname}.md" == str(PAGE.relative_to(ROOT)):
        found = list(messages())
        if wrong := faults(source[0], found):
            raise RuntimeError("; ".join(wrong))
        source[0] = _GROUP.sub(lambda one: _listing(tuple(one[1].split()), found), source[0])


def setup(app: Any) -> dict[str, bool]:
    """Register the listing with Sphinx."""
    app.connect("source-read", _insert)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    if wrong := faults(PAGE.read_text(), list(messages())):
        sys.exit("\n".join(wrong))
    print(f"{len(list(messages()))} messages in {len(groups(PAGE.read_text()))} groups")
