"""The process around a command: standard streams, signals, and pipes that are closed early."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

from soilml.io.plain_text import escaped


def fail(text: str, status: int) -> int:
    """Print `text` as one line on standard error; returns the exit status."""
    print(f"soilml: {' '.join(escaped(text).split())}", file=sys.stderr)
    return status


def reserve_standard_descriptors() -> None:
    """Open the null device for closed standard streams.

    Otherwise the first file that is opened would get descriptor 1 or 2, and receive what is
    printed.
    """
    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
            pass
        os.close(descriptor)
    if sys.stderr is None:
        sys.stderr = io.StringIO()  # print(file=None) would write to standard output


def silence_stdout() -> None:
    """Redirect standard output to the null device, so that flushing it cannot fail again."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
