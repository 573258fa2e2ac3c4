"""Writes docs/reference/constants.md: the numbers that the methods were given, with their reasons.

`python docs/site/constant_listing.py` renews the page from the sources; a test fails where the
page and the sources differ.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/reference/constants.md"
#: The rooms where numbers are made, and what the page calls them.
ROOMS = {
    "soilml/physics": "Forward model",
    "soilml/identification": "Identification",
    "soilml/gap": "Gap workflow",
    "soilml/onboard": "On board",
}
HEAD = """# Constants of the methods

Every number that a method of soilml was given rather than computes, with its reason: tolerances,
thresholds, assumed spreads, sizes of grids. Those that were tuned say on what. The figures of
[BENCHMARKS.md](../../BENCHMARKS.md) were measured with these values. The usual sizes of effects are
in the [catalogue](../physics.md). `python docs/site/constant_listing.py` writes this page from the
sources.
"""


def listing(room: str) -> str:
    """The section of a room: its files, and the constants of each."""
    parts = [f"## {ROOMS[room]}\n"]
    for file in sorted((ROOT / room).rglob("*.py")):
        constants = list(_constants(file.read_text()))
        if constants and not re.search("/html/|figure|/plot", str(file)):
            parts.append(f"`{file.relative_to(ROOT)}`\n\n" + "".join(constants))
    return "\n".join(parts)


def _constants(source: str) -> Iterator[str]:
    """The constants of a module that hold numbers, each with the comment above it."""
    lines = source.splitlines()
    for node in ast.parse(source).body:
        match node:
            case ast.Assign(targets=[target], value=ast.expr() as value):
                pass
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                pass
            case _:
                continue
        if re.match(r"_?[A-Z]", name := _unparsed(target)) and _has_number(value):
            yield f"- `{name} = {_unparsed(value)}`{_comment(lines, node)}\n"


def _unparsed(node: ast.expr) -> str:
    """An expression on one line; the parts of a tuple without its brackets."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    return ", ".join(ast.unparse(part) for part in parts)


def _has_number(value: ast.expr) -> bool:
    constants = (node.value for node in ast.walk(value) if isinstance(node, ast.Constant))
    return any(isinstance(constant, int | float) for constant in constants)


def _comment(lines: list[str], node: ast.stmt) -> str:
    """The comment of a constant, from the lines above it or from its own."""
    above: list[str] = []
    for line in reversed(lines[: node.lineno - 1]):
        if not line.startswith("#"):
            break
        above.insert(0, line.lstrip("#: "))
    _, mark, beside = lines[node.lineno - 1].partition("  # ")
    text = " ".join([*above, *([beside] if mark else [])]).strip(" .:")
    return f": {text}" if text else ""


if __name__ == "__main__":
    PAGE.write_text("\n".join([HEAD, *map(listing, ROOMS)]))
