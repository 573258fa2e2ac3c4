"""Values as they are written in a map."""

from __future__ import annotations

import json
from typing import Any

import numpy as np


def toml_value(value: Any) -> str:
    """A value in TOML: numbers without needless digits, patterns in single quotes."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int | np.number):
        return f"{float(value):g}" if float(value) != int(value) else f"{int(value)}"
    if isinstance(value, str) and "\\" in value and "'" not in value:
        return f"'{value}'"
    return json.dumps(value, ensure_ascii=False)
