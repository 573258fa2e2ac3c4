"""Estimates of single readings by the graph of a model file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.session import Session

#: Outputs of the graph for single readings.
ROW_OUTPUTS = ("mean", "std", "covariance", "in_range")
#: Rows fed to the graph at a time: bounds its working memory, which the runtime keeps.
ROWS_PER_CALL = 4096


def run_rows(session: Session, rows: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[Any]]:
    """Mean and std (m, q), covariance (m, q, q), float64, and the flag in_range (m,).

    Parameters
    ----------
    session : InferenceSession
        Of the file.
    rows : mapping of str to ndarray
        Readings (m,) by input name.
    """
    with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
        feed = dict(zip(rows, np.array(list(rows.values()), np.float32), strict=True))
    count = len(next(iter(feed.values())))
    pieces = [
        session.run(ROW_OUTPUTS, {n: v[first : first + ROWS_PER_CALL] for n, v in feed.items()})
        for first in range(0, max(count, 1), ROWS_PER_CALL)
    ]
    joined = pieces[0] if len(pieces) == 1 else map(np.concatenate, zip(*pieces, strict=True))
    mean, std, covariance, in_range = joined
    values = (mean.astype(np.float64), std.astype(np.float64), covariance.astype(np.float64))
    return dict(zip(ROW_OUTPUTS, (*values, in_range), strict=True))
