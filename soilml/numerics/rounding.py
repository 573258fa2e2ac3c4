"""Numbers without the digits that an estimate does not determine."""

from __future__ import annotations

#: Significant digits of estimates in files: a millionth of the value is far below any uncertainty.
DIGITS = 6


def significant(value: float, digits: int = DIGITS) -> float:
    """A number rounded to significant digits.

    >>> significant(0.05407576875886196), significant(45769539.457, 4)
    (0.0540758, 45770000.0)
    """
    return float(f"{value:.{digits}g}")
