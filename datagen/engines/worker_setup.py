"""What every worker process does before its first task."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from functools import cache

from threadpoolctl import threadpool_limits

#: Parameters of `mallopt` in the GNU C library, and sizes in bytes.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
KEPT = 64 << 20


def usable_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def prepare_worker() -> None:
    """One thread of linear algebra in this process, and freed memory kept for the next piece.

    The GNU C library returns freed memory to the system, and clears it when it is asked for again:
    that takes longer than the arithmetic on arrays of a piece. Nothing is done elsewhere.
    """
    threadpool_limits(1)
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            library.mallopt(_MMAP_THRESHOLD, KEPT // 2)
            library.mallopt(_TRIM_THRESHOLD, KEPT)
