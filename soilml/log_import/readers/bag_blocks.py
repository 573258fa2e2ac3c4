"""Compressed blocks of recordings: what they hold unpacked, before a library unpacks them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from soilml.io.bounds import BLOCK_BYTES

_MCAP, _ROS1 = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n"
_CHUNK = 6  # Record of MCAP
_ZSTD = b"\x28\xb5\x2f\xfd"


def check_blocks(file: Path) -> None:
    """Raise `InputError` for a block that unpacks to more than may be read.

    file: An MCAP file or a bag of ROS 1; of others nothing is said.
    """
    with file.open("rb") as opened:
        head = opened.read(len(_ROS1))
        if head.startswith(_MCAP):
            opened.seek(len(_MCAP))
            sizes = _mcap_sizes(opened)
        elif head == _ROS1:
            sizes = _ros1_sizes(opened)
        else:
            return
        for size in sizes:
            BLOCK_BYTES.check(file, size)


def _mcap_sizes(opened: BinaryIO) -> Iterator[int]:
    """Of each chunk (https://mcap.dev/spec): opcode, length, times, size unpacked, checksum."""
    while len(head := opened.read(9)) == 9:
        kind, length = struct.unpack("<BQ", head)
        after = opened.tell() + length
        if kind == _CHUNK and len(fixed := opened.read(32)) == 32:
            (size,) = struct.unpack_from("<Q", fixed, 16)
            (name,) = struct.unpack_from("<I", fixed, 28)
            opened.seek(min(name, 64) + 8, 1)
            yield max(size, _zstd_size(opened.read(18)))
        opened.seek(after)


def _ros1_sizes(opened: BinaryIO) -> Iterator[int]:
    """Of each chunk (wiki.ros.org/Bags/Format/2.0): its header states `size`."""
    while len(head := opened.read(4)) == 4:
        header = opened.read(min(struct.unpack("<I", head)[0], 1 << 20))
        for_data = opened.read(4)
        if len(for_data) < 4:
            return
        for name, value in _fields(header):
            if name == b"size" and len(value) == 4:
                yield struct.unpack("<I", value)[0]
        opened.seek(struct.unpack("<I", for_data)[0], 1)


def _fields(header: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and values of the header of a record."""
    at = 0
    while at + 4 <= len(header):
        (size,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
        yield name, value
        at += 4 + size


def _zstd_size(frame: bytes) -> int:
    """The size that a frame of Zstandard states (RFC 8878, 3.1.1.1), which its library trusts."""
    if len(frame) < 18 or not frame.startswith(_ZSTD):
        return 0
    mark = frame[4]
    single, width = mark >> 5 & 1, (0, 2, 4, 8)[mark >> 6]
    width = width or single
    at = 5 + (not single) + (0, 1, 2, 4)[mark & 3]
    return int.from_bytes(frame[at : at + width], "little") + 256 * (width == 2)
