"""Places of tensors in the working memory: tensors that are not needed together share it."""

from __future__ import annotations

from dataclasses import dataclass

from training.export_c.program import Program
from training.export_c.sizes import total

#: Elements to a multiple of which places are rounded: a cache line of 64 bytes has 16 floats.
GRAIN = 16


@dataclass(frozen=True)
class MemoryPlan:
    """Offset of each tensor in the array of its type, and the length of each array."""

    offsets: dict[str, int]
    lengths: dict[str, int]


def plan_memory(program: Program, kept: frozenset[str]) -> MemoryPlan:
    """Place every tensor of a program, each as low as its neighbours in time allow.

    Parameters
    ----------
    program : Program
        Statements with the tensors that they touch.
    kept : frozenset of str
        Names that are needed after the last statement.
    """
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for index, statement in enumerate(program.statements):
        for name in statement.names:
            first.setdefault(name, index)
            last[name] = len(program.statements) if name in kept else index
    offsets: dict[str, int] = {}
    lengths: dict[str, int] = {}
    placed: list[tuple[str, str, int, int]] = []
    for name in first:
        kind, shape = program.memory[name]
        need = max(total(shape).most(program.bounds), 1)
        need = -(-need // GRAIN) * GRAIN
        busy = sorted(
            (start, end)
            for other, of_kind, start, end in placed
            if of_kind == kind and last[other] >= first[name]
        )
        start = 0
        for begin, end in busy:
            if begin - start >= need:
                break
            start = max(start, end)
        offsets[name] = start
        placed.append((name, kind, start, start + need))
        lengths[kind] = max(lengths.get(kind, 0), start + need)
    return MemoryPlan(offsets, lengths)
