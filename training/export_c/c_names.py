"""Names of C files, which begin the names of their functions."""

from __future__ import annotations

import re
from pathlib import Path

from soilml.errors import InputError
from soilml.io.cell_text import one_line

#: Headers of the C library: a header of the same name beside the C file would be read for them.
LIBRARY_HEADERS = frozenset(
    (
        *("assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits"),
        *("locale", "math", "setjmp", "signal", "stdalign", "stdarg", "stdatomic", "stdbool"),
        *("stddef", "stdint", "stdio", "stdlib", "stdnoreturn", "string", "tgmath", "threads"),
        *("time", "uchar", "wchar", "wctype"),
    )
)


def check_c_name(file: Path) -> None:
    """Raise `InputError` for a name that cannot begin the names of functions, or hides a header."""
    if file.stem in LIBRARY_HEADERS:
        raise InputError(
            f"{one_line(file)}: {file.stem}.h beside it would hide <{file.stem}.h> of the C "
            "library; give it another name, as in wheel.c"
        )
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", file.stem):
        raise InputError(
            f"{one_line(file)}: {file.stem!r} begins the names of the C functions; needed are "
            "lower-case letters, digits and underscores, and a letter first, as in wheel.c"
        )
