"""The rows that a tracker remembers: blocks of them, the last ones of one row each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.onboard.memory import Memory

BLOCKS = 16  # Blocks of a window that is full; one more grows until the oldest is forgotten
#: Rows that must disagree with those before, and agree with each other, for another soil.
LEAST_ROWS = 3
#: Last rows that are kept one by one, so that a change among them is found where it began.
RECENT_ROWS = 24


@dataclass(frozen=True)
class RowWindow:
    """Memories of consecutive rows, and the memory of all of them.

    All rows of a window have the same weight, as in the likelihood. With weights that fade
    exponentially, the posterior would claim twice the variance that the estimate has.

    blocks: Consecutive rows, the oldest first; the last ones are of one row each.
    memory: All rows of the blocks, packed.
    length: Rows that are remembered at least, once there were so many.
    added: What each of the last rows added to the misfit, (recent,).
    """

    blocks: tuple[Memory, ...]
    memory: Memory
    length: int
    added: tuple[float, ...] = ()

    @property
    def rows_per_block(self) -> int:
        """Rows after which another block begins, but for the last rows."""
        return -(-self.length // BLOCKS)

    def with_rows(self, after: Memory, added: float = 0.0) -> RowWindow:
        """The window with one more row, or its first ones, from its memory after them, not packed.

        added: What the row added to the misfit.
        """
        system = after.system[len(self.memory.system) :]
        last = replace(after, system=system, counts=after.counts - self.memory.counts)
        blocks, rises = (*self.blocks, last), (*self.added, added)
        if len(rises) > min(RECENT_ROWS, self.length // 2):
            first, rises = len(blocks) - len(rises), rises[1:]
            older, one = blocks[:first], blocks[first]
            if older and older[-1].rows < self.rows_per_block:
                older, one = older[:-1], join((older[-1], one))
            blocks = (*older, one, *blocks[first + 1 :])
        return replace(self, blocks=blocks, memory=after.packed(), added=rises)

    def since(self, block: int) -> RowWindow:
        """The window without the blocks before this one."""
        blocks = self.blocks[block:]
        return replace(self, blocks=blocks, memory=join(blocks), added=self.added[-len(blocks) :])

    def suspect(self, excess: float) -> int:
        """The block with which another soil begins most likely: the last ones added most.

        excess: What a sound row adds to the misfit on the mean.
        """
        over = np.cumsum(np.asarray(self.added[::-1]) - excess)[LEAST_ROWS - 1 :]
        most = LEAST_ROWS + int(np.argmax(over)) if over.size else LEAST_ROWS
        return len(self.blocks) - most


def join(memories: Sequence[Memory]) -> Memory:
    """The memory of the rows of one or more others."""
    system = np.concatenate([memory.system for memory in memories])
    counts = np.stack([memory.counts for memory in memories]).sum(axis=0).astype(np.float32)
    return replace(memories[0], system=system, counts=counts).packed()
