"""Tables with a line for each reading, as exports of CAN are: time, signal, value and unit."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from soilml.log_import.recording import Recording
from soilml.remarks import Remark

_MOST, _FEWEST = 200, 8  # Most signals, and fewest readings of each
_CHANGES = 0.2  # Share of the lines at which the name changes; runs and states change seldom
_UNITS = ("unit", "units", "einheit", "unidad", "unité", "单位")


def signals_of(recording: Recording) -> list[Recording]:
    """A recording for each signal of a table of readings; the table itself where it is none.

    Such a table has a text that changes from line to line, one column of numbers beside the time,
    and perhaps the unit as text.
    """
    texts = recording.texts
    signals = [n for n in texts if n.lower() not in _UNITS and _is_signal(texts[n])]
    numbers = [name for name, own in recording.columns.items() if np.isfinite(own).any()]
    clocks = [name for name in numbers if _rises(recording, name)]
    if not signals or len(numbers) != 2 or len(clocks) != 1:
        return [recording]
    signal, (clock,) = max(signals, key=lambda n: len({*texts[n]})), clocks
    (value,) = (name for name in numbers if name != clock)
    of_unit = next((name for name in texts if name.lower() in _UNITS), "")
    said = Remark("long-table", f"each line is one reading of {signal!r}", (signal,), "note")
    cells, known = np.asarray(texts[signal]), np.isfinite(recording.columns[clock])
    found = []
    for name in dict.fromkeys(texts[signal]):
        own = recording.rows((cells == name) & known)
        columns = {clock: own.columns[clock], name: own.columns[value]}
        units = {clock: recording.units.get(clock, "")}
        units[name] = own.texts[of_unit][0] if of_unit else ""
        notes = (*recording.notes, said)
        found.append(Recording("", own.file, columns, {}, units, about=own.about, notes=notes))
    return found


def _is_signal(cells: list[str]) -> bool:
    """Whether a text (n,) is a few names that take turns."""
    counts = Counter(cells)
    if not 1 < len(counts) <= _MOST or min(counts.values()) < _FEWEST or "" in counts:
        return False
    return sum(a != b for a, b in pairwise(cells)) > _CHANGES * len(cells)


def _rises(recording: Recording, name: str) -> bool:
    values = recording.columns[name]
    values = values[np.isfinite(values)]
    # compared, not subtracted: differences of huge numbers overflow
    return values.size > 1 and bool(np.all(values[1:] >= values[:-1])) and values[-1] > values[0]
