"""Numbers that are no readings: codes of loggers for a missing one, such as -9999; huge ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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
    notes = list(recording.notes)

    def known(name: str, values: Floats, with_code: bool = True) -> Floats:
        if (huge := np.abs(values) >= _HUGE).any():
            text = f"{name}: {int(huge.sum())} numbers of {_HUGE:g} or more are no readings"
            notes.append(Remark("huge-numbers", text, (name,)))
            values = np.where(huge, np.nan, values)
        if with_code and (code := _code_of(values)) is not None:
            found = values == code
            text = f"{name}: {code:g} is no reading, and left out {int(found.sum())} times"
            notes.append(Remark("missing-code", text, (name,)))
            values = np.where(found, np.nan, values)
        return values

    clock = recording.clock
    if clock is not None:
        clock = known("the clock", clock, with_code=False)
    columns = {name: known(name, values) for name, values in recording.columns.items()}
    return replace(recording, columns=columns, clock=clock, notes=tuple(notes))


def _code_of(values: Floats) -> float | None:
    """The code of a missing reading in a column; None where it has none."""
    known = values[np.isfinite(values)]
    for end in (float(known.min()), float(known.max())) if known.size >= _LEAST else ():
        rest = known[known != end]
        digits = f"{abs(end):.10g}".replace(".", "")
        is_code = (len(digits) >= 3 and {*digits} == {"9"}) or end in _ENDS
        if is_code and rest.size and known.size - rest.size >= _LEAST:
            low, high = float(rest.min()), float(rest.max())
            if max(low - end, end - high) > _RANGES * (high - low):
                return end
    return None
