"""How the flags of foreign readings are written: tables and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from foreign import Kind

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Share of flags that counts as flagged; rms error in sigma below which a fault does no harm; size
#: that is shown first.
GOAL, LITTLE, SHOWN = 0.95, 1.3, 16
CHANNELS = ("Torque alone", "Torque, sinkage and drawbar pull")
ABOUT = (
    "The wheel of the recipe, six slips at six loads, 2 % torque noise. Shares in %: flagged; what "
    "the least misfit of the exact model flags at 1 %; and what the test flags, at 1 %, that is "
    "told the fault and its size, about the most that any test can. Error: rms of c, phi and K in "
    "their sigma where wheel.onnx flags nothing; 1 is sound. On the left torque alone, on the "
    "right sinkage and drawbar pull too."
)
CELLS = "Each cell: wheel.onnx / any_wheel.onnx / least misfit / told, %."
FALSELY = "Sets without a fault, in %: wheel.onnx / any_wheel.onnx."


@dataclass(frozen=True)
class Cell:
    """Shares flagged by each file, the misfit, and the test that knows the fault.

    `error` is the rms error of what was not flagged by each file, in its sigma, (files, 3).
    """

    shares: tuple[float, ...]
    error: Floats


def heading(first: str, sizes: Sequence[int]) -> str:
    """The head of a table with a column for each size."""
    names = [first, *(f"{n} row{'s' if n > 1 else ''}" for n in sizes)]
    return f"| {' | '.join(names)} |\n|{'---|' * len(names)}"


def percent(share: float) -> str:
    """Without a sign."""
    return f"{100 * share:.0f}"


def spoken(error: Floats) -> str:
    """Rms errors in sigma."""
    return " ".join("-" if np.isnan(e) else f"{e:.1f}" for e in error)


def written(found: dict[tuple[Kind, bool, int], Cell], sizes: Sequence[int]) -> str:
    """All cells, torque alone and with other channels."""
    parts = []
    for three, title in enumerate(CHANNELS):
        lines = [f"**{title}**", "", heading("fault", sizes)]
        for kind in dict.fromkeys(k for k, t, _ in found if t == three):
            cells = [found[kind, bool(three), n] for n in sizes]
            shares = ["/".join(map(percent, c.shares)) for c in cells]
            lines.append(f"| {kind.name} | {' | '.join(shares)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def short(found: dict[tuple[Kind, bool, int], Cell]) -> str:
    """Of the first file at one size: flagged, possible, error of what is not, and in words."""
    columns = "flagged | by misfit | told | error, sigma | |"
    lines = [f"| fault, {SHOWN} rows | {columns} {columns}", "|---" * 11 + "|"]
    for kind in dict.fromkeys(k for k, _, _ in found):
        line = f"| {kind.name} |"
        for three in (False, True):
            if c := found.get((kind, three, SHOWN)):
                shares = " | ".join(map(percent, (c.shares[0], *c.shares[-2:])))
                line += f" {shares} | {spoken(c.error[0])} | {verdict(c)} |"
            else:
                line += " | | | | not read |"
        lines.append(line)
    return "\n".join(lines)


def verdict(c: Cell) -> str:
    """In words, of the first file."""
    file, misfit, knowing = c.shares[0], *c.shares[-2:]
    if file >= GOAL:
        return "flagged"
    if misfit >= GOAL:
        return "could be flagged"
    if np.nanmax(c.error[0]) < LITTLE:
        return "changes little"
    return "only told" if knowing >= GOAL else "like another soil"
