"""Stack and calls of the functions of a C file, as gcc states them."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from compiled_c import WARNINGS

BOUNDED = ("static", "dynamic,bounded")  # Frames whose size gcc knows, or its largest value


@dataclass(frozen=True)
class CallGraph:
    """The functions of a C file.

    stack: Bytes of the frame by function; None for one of the C library.
    calls: The functions that a function calls.
    """

    stack: Mapping[str, int | None]
    calls: Mapping[str, frozenset[str]]

    def deepest(self, name: str, above: tuple[str, ...] = ()) -> tuple[int, tuple[str, ...]]:
        """Bytes of a function with all that it calls, at most, and the path of calls."""
        assert name not in above, f"{name} calls itself"
        below = [self.deepest(other, (*above, name)) for other in self.calls.get(name, ())]
        most, path = max(below, default=(0, ()))
        return (self.stack.get(name) or 0) + most, (name, *path)

    def deepest_of_all(self) -> tuple[int, tuple[str, ...]]:
        """The same of the function for which it is largest."""
        return max(self.deepest(name) for name, size in self.stack.items() if size is not None)


def call_graph(source: Path, out: Path) -> CallGraph:
    """Compile a file by gcc at -O2 without a warning, to an object file, and read its calls."""
    command = ["gcc", *WARNINGS, "-O2", "-fcallgraph-info=su", "-c", source, "-o", out]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr[:2000]
    text = out.with_suffix(".ci").read_text()
    stack: dict[str, int | None] = {}
    calls: dict[str, set[str]] = {}
    for name, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
        size = re.search(r"(\d+) bytes \(([\w,]+)\)", label)
        stack[name] = None if size is None else int(size[1])
        assert size is None or size[2] in BOUNDED, f"{name} has a stack without bound"
    for one, other in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
        calls.setdefault(one, set()).add(other)
    return CallGraph(stack, {name: frozenset(called) for name, called in calls.items()})
