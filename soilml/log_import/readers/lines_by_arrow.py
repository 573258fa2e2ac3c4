"""Long text logs of numbers alone, by the reader of pyarrow where it is installed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.readers.text_layout import MISSING, TextLayout

_LONG = 2000  # Lines from which a log is read at once


def read_by_arrow(lines: Sequence[str], layout: TextLayout) -> dict[str, Floats] | None:
    """The columns of a long log of numbers alone, read at once; None for any other.

    What is not plain, such as a second header, a date or a line of another width, is left to the
    reader of lines, which says what it finds.
    """
    if len(lines) - layout.first < _LONG or layout.separator == " ":
        return None
    try:
        import pyarrow as pa
        from pyarrow import csv as arrow
    except ImportError:
        return None
    missing = [spelt for cell in MISSING for spelt in {cell, cell.upper(), cell.title(), "NaN"}]
    try:
        table = arrow.read_csv(
            pa.py_buffer("\n".join(lines[layout.first :]).encode()),
            arrow.ReadOptions(column_names=list(layout.names), use_threads=False),
            arrow.ParseOptions(delimiter=layout.separator, quote_char=False),
            arrow.ConvertOptions(
                column_types=dict.fromkeys(layout.names, pa.float64()),
                null_values=missing,
                decimal_point="," if layout.decimal_comma else ".",
            ),
        )
    except (pa.ArrowInvalid, pa.ArrowKeyError):
        return None
    return {name: table[name].to_numpy().astype(np.float64) for name in layout.names}
