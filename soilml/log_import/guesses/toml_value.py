"""Values as they are written in a map."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from soilml.io.cell_text import is_plain


def toml_value(value: Any) -> str:
    """A value in TOML: numbers without needless digits, patterns in single quotes.

    Characters that are not plain are written as escapes, and half a pair of surrogates, which TOML
    does not have, as a question mark.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int | np.number):
        return f"{float(value):g}" if float(value) != int(value) else f"{int(value)}"
    if isinstance(value, str) and "\\" in value and "'" not in value and is_plain(value):
        return f"'{value}'"
    written = json.dumps(value, ensure_ascii=False).encode("utf-8", "replace").decode()
    return "".join(c if is_plain(c) else f"\\U{ord(c):08x}" for c in written)
