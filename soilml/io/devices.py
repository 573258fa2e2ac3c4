"""Devices, such as /dev/zero, are no input: of some there is no end, others wait for someone."""

from __future__ import annotations

import errno
import stat
from pathlib import Path


def refuse_device(path: Path) -> None:
    """Raise `OSError` where the path is missing, or a device; files, folders and pipes pass."""
    mode = path.stat().st_mode
    if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        raise OSError(errno.EINVAL, "it is a device; needed is a file")
