"""ROS 1 and ROS 2 bags by rosbags; other MCAP files by mcap."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from soilml.errors import InputError, MissingLibraryError
from soilml.io.bounds import BLOCK_BYTES
from soilml.log_import.readers.message_fields import TopicColumns, protobuf_fields, thin_largest
from soilml.log_import.recording import Recording
from soilml.optional_imports import need
from soilml.remarks import Remark, texts

_BETWEEN = 2000  # Messages between two looks at memory and progress
_MCAP, _ROS1, _ZSTD = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"\x28\xb5\x2f\xfd"
_CHUNK = 6  # Record of MCAP


def read_bag(path: Path, progress: Callable[[int], None] | None = None) -> list[Recording]:
    """One recording for each topic of a bag: a .bag file, a folder of ROS 2, or an MCAP file.

    Raises `InputError` for a damaged bag and one without numbers, `MissingLibraryError` where the
    extra `logs` is not installed.
    """
    for library in ("rosbags", "mcap"):
        need(library, "import", "logs")
    topics: dict[str, TopicColumns] = {}
    messages = _mcap_messages if path.suffix == ".mcap" else _ros_messages
    notes: list[Remark] = []
    read = 0
    try:
        if path.is_file():
            check_blocks(path)
        for i, (topic, seconds, message, size) in enumerate(messages(path, notes)):
            topics.setdefault(topic, TopicColumns(path)).add(seconds, message)
            read += size
            if i % _BETWEEN == 0:
                thin_largest(topics.values())
                if progress is not None:
                    progress(read)
    except (InputError, MissingLibraryError):
        raise
    except Exception as error:  # the libraries raise many kinds for damaged files
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path} cannot be read as a bag: {first}") from None
    found = [
        Recording(topic, path, columns, clock=held.times(), notes=(*notes, *held.notes(topic)))
        for topic, held in topics.items()
        if (columns := held.columns())
    ]
    if not found:
        raise InputError(
            f"{path}: no topic has numbers that can be read; {'; '.join(texts(notes))}"
        )
    return found


def _ros_messages(path: Path, notes: list[Remark]) -> Iterator[tuple[str, float, Any, int]]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        unknown: set[str] = set()
        for connection, nanoseconds, raw in reader.messages():
            if connection.topic in unknown:
                continue
            try:
                message = reader.deserialize(raw, connection.msgtype)
            except KeyError:
                unknown.add(connection.topic)
                text = f"{connection.topic}: type {connection.msgtype} is not known"
                notes.append(Remark("unknown-type", text, (connection.topic,)))
                continue
            yield connection.topic, 1e-9 * nanoseconds, message, len(raw)


def _mcap_messages(path: Path, notes: list[Remark]) -> Iterator[tuple[str, float, Any, int]]:
    from mcap.reader import make_reader

    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    with path.open("rb") as opened:
        for schema, channel, message in make_reader(opened).iter_messages():
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(schema, channel.message_encoding)
                if decoders[channel.id] is None:
                    kind = channel.message_encoding or "unknown"
                    text = (
                        f"{channel.topic}: encoding {kind} is not read (json, protobuf, cdr, ros1)"
                    )
                    notes.append(Remark("unknown-encoding", text, (channel.topic,)))
            decode = decoders[channel.id]
            if decode is not None:
                data = message.data
                yield channel.topic, 1e-9 * message.log_time, decode(data), len(data)


def _decoder(schema: Any, encoding: str) -> Callable[[bytes], Any] | None:
    if encoding == "json":
        return json.loads
    if encoding == "protobuf" and schema is not None:
        need("mcap_protobuf", "import", "logs")
        from mcap_protobuf.decoder import DecoderFactory

        parse_message = DecoderFactory().decoder_for(encoding, schema)
        return None if parse_message is None else lambda data: protobuf_fields(parse_message(data))
    if schema is None or encoding not in ("cdr", "ros1"):
        return None
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
    text = schema.data.decode(errors="replace")
    if name not in store.types:
        parse = get_types_from_idl if schema.encoding == "ros2idl" else None
        store.register(parse(text) if parse else get_types_from_msg(text, name))
    decode: Callable[..., Any] = (
        store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    )
    return lambda data: decode(data, name)


def check_blocks(file: Path) -> None:
    """Raise `InputError` for a compressed block that unpacks to more than may be read.

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
        at = 0
        while at + 4 <= len(header):  # its fields, NAME=VALUE
            (size,) = struct.unpack_from("<I", header, at)
            name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
            if name == b"size" and len(value) == 4:
                yield struct.unpack("<I", value)[0]
            at += 4 + size
        opened.seek(struct.unpack("<I", for_data)[0], 1)


def _zstd_size(frame: bytes) -> int:
    """The size that a frame of Zstandard states (RFC 8878, 3.1.1.1), which its library trusts."""
    if len(frame) < 18 or not frame.startswith(_ZSTD):
        return 0
    mark = frame[4]
    single, width = mark >> 5 & 1, (0, 2, 4, 8)[mark >> 6]
    width = width or single
    at = 5 + (not single) + (0, 1, 2, 4)[mark & 3]
    return int.from_bytes(frame[at : at + width], "little") + 256 * (width == 2)
