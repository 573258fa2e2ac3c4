"""Which column is the clock of a log, and what divides the log into runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from soilml.log_import.guesses.behaviour import time_unit
from soilml.log_import.guesses.candidates import candidates_of
from soilml.log_import.guesses.column_words import name_scores
from soilml.log_import.recording import Recording

#: Lowest score of a clock, and most runs of one file.
_LEAST, _MOST_RUNS = 0.5, 1000


def guess_clock(recordings: Sequence[Recording]) -> tuple[str, str]:
    """Column of time and its unit; two empty texts where there is none."""
    best = (_LEAST, "", "")
    for recording in recordings:
        if recording.clock is not None:
            continue
        for candidate in candidates_of([recording]):
            score = candidate.scores.get("time", 0.0)
            if score > best[0]:
                unit = candidate.unit if candidate.kind == "s" else ""
                values = recording.columns[candidate.name]
                best = (score, candidate.name, unit or time_unit(values))
    return best[1], best[2]


def guess_run_column(recordings: Sequence[Recording]) -> tuple[str, int]:
    """A column whose value names the run, and how many there are; "" where no column does."""
    for recording in recordings:
        columns = dict(recording.texts)
        for name, values in recording.columns.items():
            if "run" in name_scores(name) and np.isfinite(values).all():
                columns[name] = [f"{value:g}" for value in values]
        for name, cells in columns.items():
            count = len(set(cells))
            changes = sum(a != b for a, b in pairwise(cells))
            if 1 < count <= min(_MOST_RUNS, len(cells) / 20) and changes == count - 1:
                return name, count
    return "", 0


def restarts(recordings: Sequence[Recording], column: str) -> int:
    """How often the clock starts again from its beginning."""
    for recording in recordings:
        if column in recording.columns:
            values = recording.columns[column]
            steps = np.diff(values)
            back = steps < -0.2 * np.nanmax(np.abs(values - values[0]))
            return int(back.sum()) if back.sum() == np.sum(steps < 0.0) else 0
    return 0
