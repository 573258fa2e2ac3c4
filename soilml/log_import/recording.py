"""What a reader finds in a log: columns of samples with one clock."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.remarks import Remark


@dataclass(frozen=True)
class Recording:
    """Columns of equal length (n,), as they stand in a file: one table, topic or struct."""

    name: str  # Topic, struct or kind of file; "" where a file holds one table
    file: Path  # The file
    columns: dict[str, Floats]  # Numbers by column, NaN where a cell is blank or not a number
    # Columns that hold text, such as names of runs and times of day
    texts: dict[str, list[str]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)  # Units by column, as the log writes them
    # Time of each sample in s, where the format has one (bags); None where a column has it
    clock: Floats | None = None
    # Lines before the header, which may state the radius of the wheel or the sampling rate
    about: tuple[str, ...] = ()
    notes: tuple[Remark, ...] = ()  # What the reader repaired or left out

    def __len__(self) -> int:
        if self.clock is not None:
            return len(self.clock)
        held: list[Floats | list[str]] = [*self.columns.values(), *self.texts.values()]
        return len(held[0]) if held else 0

    def rows(self, keep: NDArray[np.bool_]) -> Recording:
        """The samples of a mask (n,)."""
        picked = np.flatnonzero(keep)
        return replace(
            self,
            columns={name: values[keep] for name, values in self.columns.items()},
            texts={name: [cells[i] for i in picked] for name, cells in self.texts.items()},
            clock=None if self.clock is None else self.clock[keep],
        )
