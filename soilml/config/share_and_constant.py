"""A standard deviation as a share of a quantity, in its unit, or both."""

from __future__ import annotations

import math
import re
from typing import Any

from soilml.io.toml_settings import Settings

#: Largest share of a reading, and largest constant part, in the unit of any column.
MOST_SHARE, MOST_CONSTANT = 100.0, 1e9
_SHARE = re.compile(r"\s*([0-9.eE+-]+)\s*%\s*(?:\+\s*([0-9.eE+-]+)\s*)?")


def take_share_and_constant(settings: Settings, key: str, needed: str) -> tuple[float, float]:
    """Share, as a fraction, and constant part of `key = 0.05`, `"2 %"` or `"2 % + 0.05"`.

    Raises `InputError` for another form and for a part that is negative or too large; `needed`
    describes the three forms in its message.
    """
    value = settings.take(key, (int, float, str), needed)
    share = constant = math.nan
    try:
        if not isinstance(value, str):
            share, constant = 0.0, float(value)
        elif match := _SHARE.fullmatch(value):
            share, constant = float(match[1]) / 100.0, float(match[2] or 0.0)
        else:
            settings.fail(f"{key} is {value!r}; needed is {needed}")
    except ValueError:
        settings.fail(f"{key} is {value!r}; needed is {needed}")
    if not (math.isfinite(share + constant) and share >= 0.0 and constant >= 0.0):
        settings.fail(f"{key} is {value!r}; a standard deviation is a finite number, zero or more")
    if share > MOST_SHARE or constant > MOST_CONSTANT:
        settings.fail(
            f"{key} is {value!r}; a standard deviation is at most {100 * MOST_SHARE:g} % and "
            f"{MOST_CONSTANT:g}"
        )
    return share, constant


def share_and_constant_as_setting(share: float, constant: float) -> Any:
    """The two parts as they are written in TOML."""
    text = f"{100 * share:.15g} %"
    if share and constant:
        return f"{text} + {constant!r}"
    return text if share else constant
