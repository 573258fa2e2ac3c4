"""Names of C files, which begin the names of their functions."""

from __future__ import annotations

import re
from pathlib import Path

from soilml.errors import InputError
from soilml.io.cell_text import one_line


def check_c_name(file: Path) -> None:
    """Raise `InputError` unless the name of a C file can begin the names of its functions."""
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", file.stem):
        raise InputError(
            f"{one_line(file)}: {file.stem!r} begins the names of the C functions; needed are "
            "lower-case letters, digits and underscores, and a letter first, as in wheel.c"
        )
