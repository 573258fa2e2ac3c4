"""Statements and branches that tests reach, by room: `make coverage`.

It reads `build/coverage.json`, which pytest-cov writes. A branch is a jump from one line to
another. A line that is reached need not be tested, which mutants tell (`make mutation`).
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
#: What is counted of each file, as coverage names it.
COUNTS = ("num_statements", "covered_lines", "num_branches", "covered_branches")


def by_room(files: Mapping[str, Mapping[str, Any]]) -> dict[str, list[int]]:
    """Counts of `COUNTS` summed over the files of each room, by the first two parts of the path."""
    rooms: defaultdict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    for path, found in files.items():
        parts = Path(path).parts
        room = "/".join(parts[:2]) if len(parts) > 2 else parts[0]
        for i, name in enumerate(COUNTS):
            rooms[room][i] += found["summary"][name]
    return dict(sorted(rooms.items()))


def table(rooms: Mapping[str, list[int]]) -> str:
    """The table in Markdown, with a last line for all rooms."""
    lines = ["| room | statements | reached | branches | reached |", "|---|---:|---:|---:|---:|"]
    every = [sum(column) for column in zip(*rooms.values(), strict=True)]
    for room, counts in [
        *((f"`{name}`", counts) for name, counts in rooms.items()),
        ("all", every),
    ]:
        statements, lines_reached, branches, branches_reached = counts
        lines.append(
            f"| {room} | {statements} | {_share(lines_reached, statements)} | {branches} | "
            f"{_share(branches_reached, branches)} |"
        )
    return "\n".join(lines)


def _share(reached: int, of: int) -> str:
    return f"{100.0 * reached / of:.1f} %" if of else ""


if __name__ == "__main__":
    found = json.loads((ROOT / "build" / "coverage.json").read_text())
    print(table(by_room(found["files"])))
