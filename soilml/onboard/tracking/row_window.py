"""The last rows of a drive, in blocks that are forgotten one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.onboard.memory import Memory

#: Blocks of a window that is full; one more grows until the oldest is forgotten.
BLOCKS = 16


@dataclass(frozen=True)
class RowWindow:
    """Memories of consecutive rows, and the memory of all of them.

    All rows of a window have the same weight, as in the likelihood. With weights that fade
    exponentially, the posterior would claim twice the variance that the estimate has.

    Parameters
    ----------
    blocks : tuple of Memory
        Consecutive rows, the oldest first; the last grows.
    memory : Memory
        All rows of the blocks, packed.
    rows_per_block : int
        Rows after which another block begins.
    """

    blocks: tuple[Memory, ...]
    memory: Memory
    rows_per_block: int

    @staticmethod
    def empty(start: Memory, length: int) -> RowWindow:
        """A window that remembers between `length` rows and a block more."""
        return RowWindow((), start, -(-length // BLOCKS))

    @property
    def is_full(self) -> bool:
        """Whether the oldest block is to be forgotten."""
        return len(self.blocks) > BLOCKS + 1

    def with_rows(self, after: Memory) -> RowWindow:
        """The window with further rows, from its memory after them, not packed."""
        system = after.system[len(self.memory.system) :]
        added = replace(after, system=system, counts=after.counts - self.memory.counts)
        if not self.blocks or self.blocks[-1].rows >= self.rows_per_block:
            blocks = (*self.blocks, added)
        else:
            blocks = (*self.blocks[:-1], join((self.blocks[-1], added)))
        return replace(self, blocks=blocks, memory=after.packed())

    def since(self, block: int) -> RowWindow:
        """The window without the blocks before this one."""
        blocks = self.blocks[block:]
        return replace(self, blocks=blocks, memory=join(blocks))

    def before(self, block: int) -> Memory:
        """The memory of the rows before this block."""
        return join(self.blocks[:block])


def join(memories: Sequence[Memory]) -> Memory:
    """The memory of the rows of one or more others."""
    system = np.concatenate([memory.system for memory in memories])
    counts = np.stack([memory.counts for memory in memories]).sum(axis=0).astype(np.float32)
    return replace(memories[0], system=system, counts=counts).packed()
