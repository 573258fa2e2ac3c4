"""Logs with one line for each reading: time, name of the signal, value."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from soilml.log_import.recording import Recording

#: Most signals, and fewest readings of each.
_MOST, _FEWEST = 200, 8
#: Share of the lines at which the name changes; runs and states change seldom.
_CHANGES = 0.2


def signals_of(recording: Recording) -> list[Recording]:
    """A recording for each signal of a table of readings; the table itself where it is none.

    Such a table has a text that changes from line to line, one column of numbers beside the time,
    and perhaps the unit as text.
    """
    numbers = [name for name, values in recording.columns.items() if np.isfinite(values).any()]
    clocks = [name for name in numbers if _rises(recording, name)]
    values = [name for name in numbers if name not in clocks]
    signals = [name for name, cells in recording.texts.items() if _is_signal(cells)]
    if len(clocks) != 1 or len(values) != 1 or not signals:
        return [recording]
    # a unit has fewer different texts than the signals, or as many and shorter ones
    texts = recording.texts
    signal = max(signals, key=lambda n: (len(set(texts[n])), sum(map(len, set(texts[n])))))
    units = next((name for name in texts if name != signal and name.lower() in ("unit", "units",
                  "einheit", "unidad", "unité", "单位")), "")  # fmt: skip
    cells, clock = np.asarray(recording.texts[signal]), clocks[0]
    found = []
    for name in dict.fromkeys(recording.texts[signal]):
        keep = (cells == name) & np.isfinite(recording.columns[clock])
        own = recording.rows(keep)
        unit = {clock: recording.units[clock]} if clock in recording.units else {}
        if units:
            unit[name] = own.texts[units][0]
        columns = {clock: own.columns[clock], name: own.columns[values[0]]}
        notes = (*recording.notes, f"each line is one reading of {signal!r}")
        found.append(
            Recording("", recording.file, columns, {}, unit, about=recording.about, notes=notes)
        )
    return found


def _is_signal(cells: list[str]) -> bool:
    counts: dict[str, int] = {}
    for cell in cells:
        counts[cell] = counts.get(cell, 0) + 1
    if not 1 < len(counts) <= _MOST or min(counts.values()) < _FEWEST or "" in counts:
        return False
    changes = sum(a != b for a, b in pairwise(cells))
    return changes > _CHANGES * len(cells)


def _rises(recording: Recording, name: str) -> bool:
    values = recording.columns[name]
    values = values[np.isfinite(values)]
    # compared, not subtracted: differences of huge numbers overflow
    return values.size > 1 and bool(np.all(values[1:] >= values[:-1])) and values[-1] > values[0]
