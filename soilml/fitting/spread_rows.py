"""A few rows that stand for all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.observations import Observations

#: Readings of each channel that are kept.
READINGS = 16


def spread_rows(data: Observations) -> NDArray[np.int64]:
    """Rows that stand for all: from the lightest to the heaviest with a reading of each channel."""
    rows = []
    for channel in data.channels:
        measured = np.flatnonzero(np.isfinite(channel.reading))
        in_order = measured[np.lexsort((data.slip[measured], data.load[measured]))]
        few = np.linspace(0, len(in_order) - 1, min(READINGS, len(in_order)))
        rows.append(in_order[few.round().astype(int)])
    return np.unique(np.concatenate(rows))
