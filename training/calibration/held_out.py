"""What a file has of its errors on rows left out, so that it can be fused with others."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.held_out_errors import HeldOutErrors
from training.dataset import Dataset

MOST_ROWS = 2000  # Most rows that a file carries


def measure_held_out(mean: Floats, std: Floats, data: Dataset) -> HeldOutErrors:
    """The errors of a file on rows that it has not seen, one of each run.

    mean, std (n, q): Estimates of the rows of `data`.
    """
    first = np.asarray([run[0] for run in data.runs()])
    if len(first) > MOST_ROWS:
        first = first[np.linspace(0, len(first) - 1, MOST_ROWS).astype(int)]
    first = first[np.argsort(data.row[first])]
    found = {
        "rows": data.row[first].tolist(),
        "truth": data.targets[first].tolist(),
        "mean": mean[first].tolist(),
        "std": std[first].tolist(),
    }
    return HeldOutErrors.of(HeldOutErrors.of(found).entry())  # as it is read back from the file
