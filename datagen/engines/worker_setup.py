"""What every worker process does before its first task."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache

from threadpoolctl import threadpool_limits

#: Parameters of `mallopt` in the GNU C library, and sizes in bytes.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
KEPT = 64 << 20


#: Most workers that this process starts at a time; None is one for each core.
_most: ContextVar[int | None] = ContextVar("most workers", default=None)


def usable_cores() -> int:
    """Workers that this process may start: its cores, or as many as `limited_workers` allows."""
    if (most := _most.get()) is not None:
        return most
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def limited_workers(most: int | None) -> Iterator[None]:
    """Inside, engines start at most so many workers; None is one for each core."""
    token = _most.set(most)
    try:
        yield
    finally:
        _most.reset(token)


def prepare_worker() -> None:
    """One thread in this process, and freed memory kept for the next task."""
    _prepare(os.getpid())  # a process that is forked from a prepared one is not prepared itself


@cache
def _prepare(process: int) -> None:
    _most.set(1)  # a task starts no workers of its own
    threadpool_limits(1)
    keep_freed_memory()


@cache
def keep_freed_memory() -> None:
    """Let the GNU C library keep freed memory of the size of a piece's arrays.

    It would return it to the system, and have it cleared when it asks for it again: that takes
    longer than the arithmetic, and more so under dask, whose workers trim memory on purpose.
    Nothing is done elsewhere.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            library.mallopt(_MMAP_THRESHOLD, KEPT // 2)
            library.mallopt(_TRIM_THRESHOLD, KEPT)
