"""Numbers that loggers write where a reading is missing, such as -9999."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.log_import.recording import Floats, Recording

#: Ends of the ranges of integers, which converters without a signal show.
_ENDS = (32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, 4294967295.0)
#: From this size on no reading of a rig is meant.
_HUGE = 1e30
#: How often a code must stand in a column, and how many ranges of all other readings away.
_LEAST, _RANGES = 2, 3.0


def without_codes(recording: Recording) -> Recording:
    """The recording with NaN where a column has the code of a missing reading; a note says it."""
    columns, notes = dict(recording.columns), list(recording.notes)
    for name, values in recording.columns.items():
        code = _code_of(values)
        if code is not None:
            found = values == code
            columns[name] = np.where(found, np.nan, values)
            notes.append(f"{name}: {code:g} is no reading, and left out {int(found.sum())} times")
    if len(notes) == len(recording.notes):
        return recording
    return replace(recording, columns=columns, notes=tuple(notes))


def _code_of(values: Floats) -> float | None:
    """The code of a missing reading in a column; None where it has none."""
    known = values[np.isfinite(values)]
    if known.size < _LEAST:
        return None
    for end in (float(known.min()), float(known.max())):
        rest = known[known != end]
        if rest.size == 0 or known.size - rest.size < _LEAST or not _looks_like_code(end):
            continue
        low, high = float(rest.min()), float(rest.max())
        if max(low - end, end - high) > _RANGES * (high - low):
            return end
    return None


def _looks_like_code(value: float) -> bool:
    digits = f"{abs(value):.10g}".replace(".", "")
    nines = len(digits) >= 3 and set(digits) == {"9"}
    return nines or value in _ENDS or abs(value) >= _HUGE
