"""How much the arrays of a MATLAB file hold, before a library reads them.

A packed element may stand for a thousand times its size, a cell array may claim any number of
cells, and each small array takes some hundred bytes beside its values.
"""

from __future__ import annotations

import math
import mmap
import struct
import zlib
from contextlib import suppress
from pathlib import Path

from soilml.io.bounds import DEPTH, LOG_VALUES, PARTS

_HEAD = 128  # Bytes before the first element; the last four are version and byte order
_MATRIX, _COMPRESSED = 14, 15
_OPAQUE = 17  # Class of arrays whose header has no dimensions
#: Bytes of a value by the type of its element ("MAT-File Format", The MathWorks, table 1-1).
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MOST_BYTES = 8 * LOG_VALUES.most + (1 << 20)  # Of a packed array that has no more values


def check_matlab_size(file: Path) -> None:
    """Raise `InputError` for more values, arrays or structs in one another than may be read.

    file: A file of version 5; of version 4, whose arrays are neither packed nor nested, nothing is
        said, nor of what is damaged.
    """
    if file.stat().st_size <= _HEAD:
        return
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        order = {b"IM": "<", b"MI": ">"}.get(data[_HEAD - 2 : _HEAD])
        if order is not None:
            _Arrays(file, order).count(data, _HEAD, len(data))


class _Arrays:
    """Values and arrays of a file, counted element by element."""

    def __init__(self, file: Path, order: str) -> None:
        self.file, self.order = file, order
        self.values = self.parts = 0

    def tag(self, data: mmap.mmap | bytes, at: int) -> tuple[int, int, int, int]:
        """Type of an element, where its content begins, its bytes, and where the next begins."""
        kind, size = struct.unpack_from(f"{self.order}II", data, at)
        if kind >> 16:  # a small element, whose content is in its tag
            return kind & 0xFFFF, at + 4, kind >> 16, at + 8
        return kind, at + 8, size, at + 8 + size + (0 if kind == _COMPRESSED else -size % 8)

    def count(self, data: mmap.mmap | bytes, at: int, end: int, depth: int = 0) -> None:
        """Count the elements between two places."""
        DEPTH.check(self.file, depth)
        while at + 8 <= end:
            kind, start, size, after = self.tag(data, at)
            if kind == _COMPRESSED and isinstance(data, mmap.mmap):
                with suppress(zlib.error):  # of a damaged file, as the library will say
                    unpacked = zlib.decompressobj().decompress(data[start:after], _MOST_BYTES)
                    LOG_VALUES.check(self.file, len(unpacked) // 8)
                    self.count(unpacked, 0, len(unpacked))
            elif kind == _MATRIX:
                self.parts += 1
                PARTS.check(self.file, self.parts)
                inner = self.after_shape(data, start, min(after, end))
                self.count(data, inner, min(after, end), depth + 1)
            elif depth:
                self.values += size // _BYTES.get(kind, 1)
                LOG_VALUES.check(self.file, self.values)
            at = after

    def after_shape(self, data: mmap.mmap | bytes, at: int, end: int) -> int:
        """Where the name of an array begins; what it claims is allocated before it is read."""
        if at + 24 > end:  # an empty one has no flags
            return end
        _, flags, _, at = self.tag(data, at)
        if struct.unpack_from(f"{self.order}I", data, flags)[0] & 0xFF == _OPAQUE:
            return at
        _, start, size, after = self.tag(data, at)
        shape = data[start : min(start + size // 4 * 4, end)]
        sizes = struct.unpack(f"{self.order}{len(shape) // 4}i", shape[: len(shape) // 4 * 4])
        LOG_VALUES.check(self.file, math.prod(max(n, 0) for n in sizes))
        return after
