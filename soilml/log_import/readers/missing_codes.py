"""Numbers that are no readings: codes of loggers for a missing one, such as -9999; huge ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.log_import.recording import Recording
from soilml.remarks import Remark

#: Ends of the ranges of integers, which converters without a signal show.
_ENDS = (32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, 4294967295.0)
_HUGE = 1e30  # From this size on no reading of a rig is meant; squares of smaller ones are finite
#: How often a code must stand in a column, and how many ranges of all other readings away.
_LEAST, _RANGES = 2, 3.0


def without_codes(recording: Recording) -> Recording:
    """The recording with NaN where a column has the code of a missing reading or a huge number, and
    where its clock has a huge one; a note says it.
    """
    columns, notes = dict(recording.columns), list(recording.notes)
    clock = recording.clock
    if clock is not None and (huge := _huge(clock)).any():
        clock = np.where(huge, np.nan, clock)
        notes.append(_note("the clock", huge))
    for name, given in recording.columns.items():
        values = given
        if (huge := _huge(values)).any():
            columns[name] = values = np.where(huge, np.nan, values)
            notes.append(_note(name, huge))
        code = _code_of(values)
        if code is not None:
            found = values == code
            columns[name] = np.where(found, np.nan, values)
            text = f"{name}: {code:g} is no reading, and left out {int(found.sum())} times"
            notes.append(Remark("missing-code", text, (name,)))
    if len(notes) == len(recording.notes):
        return recording
    return replace(recording, columns=columns, clock=clock, notes=tuple(notes))


def _huge(values: Floats) -> NDArray[np.bool_]:
    return np.asarray(np.abs(values) >= _HUGE)


def _note(name: str, left_out: NDArray[np.bool_]) -> Remark:
    text = f"{name}: {int(left_out.sum())} numbers of {_HUGE:g} or more are no readings"
    return Remark("huge-numbers", text, (name,))


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
    return nines or value in _ENDS
