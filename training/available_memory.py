"""Memory that this process may still use."""

from __future__ import annotations

import os
from pathlib import Path

#: Files of the limit and the use of the control group, where there is one.
LIMIT, USED = Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")


def available_memory() -> int | None:
    """Bytes that are free, within the limits of control group and process; None if unknown.

    Memory that only caches files counts as free.
    """
    found = [_free_of_machine(), _free_of_group(), _free_of_process()]
    known = [free for free in found if free is not None]
    return max(min(known), 0) if known else None


def _free_of_machine() -> int | None:
    table = Path("/proc/meminfo")
    if table.exists():
        for line in table.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return None


def _free_of_group() -> int | None:
    try:
        limit = LIMIT.read_text().strip()
        return None if limit == "max" else int(limit) - int(USED.read_text())
    except (OSError, ValueError):
        return None


def _free_of_process() -> int | None:
    """What `ulimit -v` leaves."""
    try:
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit == resource.RLIM_INFINITY:
            return None
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return limit - pages * os.sysconf("SC_PAGE_SIZE")
    except (ImportError, OSError, ValueError):
        return None
