"""A checksum of what is kept between steps, by which a bit that has flipped since is found."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np


def state_checksum(*parts: Any) -> int:
    """CRC-32 of texts, numbers and arrays, in order; their types and shapes take part."""
    found = 0
    for part in parts:
        array = np.ascontiguousarray(part)
        found = zlib.crc32(f"{array.dtype.str}{np.shape(part)}".encode(), found)
        found = zlib.crc32(array.tobytes(), found)
    return found
