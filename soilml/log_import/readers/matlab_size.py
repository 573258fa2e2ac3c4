"""How much the arrays of a MATLAB file hold, before a library reads them.

A packed element may stand for a thousand times its size, a cell array may claim any number of
cells, and each small array takes some hundred bytes beside its values.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from soilml.io.bounds import DEPTH, LOG_VALUES, PARTS

_HEAD = 128  # Bytes before the first element; the last four are version and byte order
_BLOCK = 1 << 16
_MATRIX, _COMPRESSED = 14, 15
_OPAQUE = 17  # Class of arrays whose header has no dimensions
#: Bytes of a value by the type of its element ("MAT-File Format", The MathWorks, table 1-1).
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}


class _Source(Protocol):
    def read(self, size: int, /) -> bytes: ...


def check_matlab_size(file: Path) -> None:
    """Raise `InputError` for more values, arrays or structs in one another than may be read.

    file: A file of version 5; of version 4, whose arrays are neither packed nor nested, nothing is
        said, nor of what is damaged.
    """
    with file.open("rb") as opened:
        order = {b"IM": "<", b"MI": ">"}.get(opened.read(_HEAD)[-2:])
        if order is not None:
            _Arrays(file, order).walk(_Counted(opened))


class _Counted:
    """A source that knows how many bytes have been read of it."""

    def __init__(self, source: _Source) -> None:
        self.source, self.at = source, 0

    def read(self, size: int) -> bytes:
        found = self.source.read(size)
        self.at += len(found)
        return found

    def skip(self, size: int) -> None:
        while size > 0 and (found := self.read(min(size, _BLOCK))):
            size -= len(found)


class _Unpacked:
    """What a packed element unpacks to, block by block; it is not kept."""

    def __init__(self, source: _Counted, size: int) -> None:
        self.blocks, self.kept, self.at = _blocks(source, size), b"", 0

    def read(self, size: int, /) -> bytes:
        found = self.kept[self.at : self.at + size]
        self.at += len(found)
        while len(found) < size and (block := next(self.blocks, b"")):
            self.kept, self.at = block, size - len(found)
            found += block[: self.at]
        return found


def _blocks(source: _Counted, size: int) -> Iterator[bytes]:
    unpack = zlib.decompressobj()
    while size > 0 and (packed := source.read(min(size, _BLOCK))):
        size -= len(packed)
        while packed:
            try:
                block = unpack.decompress(packed, _BLOCK)
            except zlib.error:  # of a damaged file, as the library will say
                return
            packed = unpack.unconsumed_tail
            if block:
                yield block
    source.skip(size)


class _Arrays:
    """Values and arrays of a file, counted element by element."""

    def __init__(self, file: Path, order: str) -> None:
        self.file, self.order = file, order
        self.values = self.parts = 0

    def walk(self, source: _Counted, end: float = math.inf, depth: int = 0) -> None:
        """Count the elements of a source up to a place in it."""
        DEPTH.check(self.file, depth)
        while source.at < end and (tag := self.tag(source)) is not None:
            kind, size, left = tag
            after = source.at + left
            if kind == _COMPRESSED and not isinstance(source.source, _Unpacked):
                self.walk(_Counted(_Unpacked(source, size)), depth=depth)
            elif kind == _MATRIX:
                self.matrix(source, after, depth)
            elif depth:
                self.count(size // _BYTES.get(kind, 1))
            source.skip(after - source.at)

    def tag(self, source: _Counted) -> tuple[int, int, int] | None:
        """Type and size of an element, and the bytes of it that follow, with their padding."""
        head = source.read(8)
        if len(head) < 8:
            return None
        kind, size = struct.unpack(f"{self.order}II", head)
        if kind >> 16:  # a small element, whose content is in its tag
            return kind & 0xFFFF, kind >> 16, 0
        return kind, size, size if kind == _COMPRESSED else size + -size % 8

    def matrix(self, source: _Counted, end: int, depth: int) -> None:
        """Count an array: flags, dimensions, name, and what it holds."""
        self.parts += 1
        PARTS.check(self.file, self.parts)
        if self.tag(source) is None:  # an empty one has no flags
            return
        flags = source.read(8)
        if len(flags) == 8 and struct.unpack(f"{self.order}I", flags[:4])[0] & 0xFF != _OPAQUE:
            tag = self.tag(source)
            if tag is not None and 0 < tag[1] <= _BLOCK:
                shape = source.read(tag[2])[: tag[1]]
                sizes = struct.unpack(
                    f"{self.order}{len(shape) // 4}i", shape[: len(shape) // 4 * 4]
                )
                # what an array claims is allocated before its content is read
                LOG_VALUES.check(self.file, math.prod(max(size, 0) for size in sizes))
        self.walk(source, end, depth + 1)

    def count(self, values: int) -> None:
        """Add values."""
        self.values += values
        LOG_VALUES.check(self.file, self.values)
