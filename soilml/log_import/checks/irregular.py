"""Windows whose motion wanders far more than that of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.log_import.window_rows import WindowRow

#: How many times the usual wandering, and how large a standard error of slip, a window may have.
_TIMES, _LEAST_ERROR = 6.0, 0.01
#: Fewest windows that tell what is usual.
_FEWEST = 4


def irregular_windows(runs: Sequence[Sequence[WindowRow]]) -> dict[tuple[int, int], str]:
    """Reasons by (run, window) for windows that are irregular in slip or in drawbar pull.

    The wandering of a window is the standard error of its mean times the square root of its
    length, which does not depend on the length. Hands on the carriage, a cable that tightens or a
    wheel that meets a stone raise it.
    """
    found: dict[tuple[int, int], str] = {}
    for name, least in (("drawbar_pull", 0.0), ("slip", _LEAST_ERROR)):
        places = [(i, k) for i, rows in enumerate(runs) for k in range(len(rows))]
        errors = np.asarray([runs[i][k].std.get(name, np.nan) for i, k in places])
        lengths = np.asarray([runs[i][k].window.stop - runs[i][k].window.start for i, k in places])
        known = np.isfinite(errors)
        if known.sum() < _FEWEST:
            continue
        wandering = errors * np.sqrt(lengths)
        usual = float(np.median(wandering[known]))
        for place, size, error in zip(places, wandering, errors, strict=True):
            if size > _TIMES * usual and error > least:
                words = name.replace("_", " ")
                found[place] = (
                    f"it is irregular: the {words} wanders {size / usual:.2g} times as much as "
                    "in the middle of the windows, as if someone had touched the rig"
                )
    return found
