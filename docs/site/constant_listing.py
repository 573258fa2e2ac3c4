"""Writes docs/reference/constants.md: the numbers that the methods were given, with their reasons.

`python docs/site/constant_listing.py` renews the page from the sources; a test fails where a
constant of the sources is not on the page, or has another value there.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/reference/constants.md"
#: The rooms where numbers are made, and what the page calls them.
ROOMS = {
    "soilml/physics": "Forward model",
    "soilml/fitting": "Fitting",
    "soilml/identification": "Identification",
    "soilml/gap": "Gap workflow",
    "soilml/onboard": "On board",
}
#: The longest value that is shown, in characters.
LONGEST = 90
HEAD = """# Constants of the methods

Numbers that the methods of soilml were given rather than compute: tolerances, thresholds, assumed
spreads, sizes of grids. Constants that were tuned state on what. The figures of
[BENCHMARKS.md](../../BENCHMARKS.md) were measured with these values. The usual sizes of effects are
in the [catalogue](../physics.md). Constants that are pure numbers or sets of numbers, and whose
meaning is stated in the sources, are listed. `python docs/site/constant_listing.py` writes the
page.
"""
TABLE = "| constant | value | meaning |\n|---|---|---|\n"


def rows(room: str) -> list[str]:
    """The rows of a room, in the order of its files; none where there is no such room."""
    files = sorted((ROOT / room).rglob("*.py"))
    shown = [file for file in files if not re.search("/html/|figure|/plot", str(file))]
    return [row for file in shown for row in _constants(file.read_text())]


def listing(room: str) -> str:
    """The section of a room."""
    return f"## {ROOMS[room]}\n\n{TABLE}" + "".join(f"{row}\n" for row in rows(room))


def _constants(source: str) -> Iterator[str]:
    """The row of each constant of a module that holds numbers and has a comment."""
    lines = source.splitlines()
    for node in ast.parse(source).body:
        match node:
            case ast.Assign(targets=[target], value=ast.expr() as value):
                pass
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                pass
            case _:
                continue
        name, meaning = _unparsed(target), _comment(lines, node)
        constant = re.match(r"_?[A-Z]", name) and _has_number(value)
        text = _value(value) if constant and meaning else ""
        if 0 < len(text) <= LONGEST:
            yield f"| `{name}` | {text} | {meaning} |"


def _value(value: ast.expr) -> str:
    """A value as a person writes it; nothing where it is neither numbers nor arithmetic."""
    try:
        return _written(ast.literal_eval(value))
    except ValueError:
        named = any(isinstance(node, ast.Dict | ast.keyword) for node in ast.walk(value))
        return "" if named else f"`{ast.unparse(value)}`"


def _written(value: Any) -> str:
    """Numbers, and numbers in tuples and by names, without brackets and quotes."""
    if isinstance(value, dict):
        return "; ".join(f"{_written(k)}: {_written(v)}" for k, v in value.items())
    if isinstance(value, tuple | list | set):
        return ", ".join(map(_written, value))
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).replace("|", "\\|")


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
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text("\n".join([HEAD, *(listing(room) for room in ROOMS if rows(room))]))
