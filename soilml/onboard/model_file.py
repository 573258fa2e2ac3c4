"""A model file: its checksums, its metadata, and the session of the ONNX runtime that runs it.

This is the one place where onnxruntime is imported: sessions run on the CPU, without telemetry. A
file that refers to other files, which its checksums do not cover, is refused: the runtime would
read them from the working folder as soon as it opens the model. Whether it does is read from its
protobuf messages, of which only those on the way to a tensor are opened (onnx.proto, IR version 3
to 11).
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

from soilml.errors import ModelFileError, did_you_mean
from soilml.onboard.set_contract import INTERFACE

# Recent wheels of onnxruntime look up a host of their vendor and write files below the home folder
# as soon as they are imported, unless this is set before.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort

Session: TypeAlias = ort.InferenceSession  # A loaded ONNX file

#: message -> field number -> message in that field
_INSIDE: dict[str, dict[int, str]] = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "function": {7: "node", 11: "attribute"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
}
#: Fields external_data and data_location of a tensor.
_EXTERNAL, _LOCATION = 13, 14
#: Fields graph and metadata_props of a model.
_GRAPH, _METADATA = 7, 14
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5
FORMAT = "3"  # Version of the file format: names of inputs and outputs, keys of the metadata
#: Largest model file, bytes. Those that `soilml train` writes have some MB at most.
MOST_BYTES = 256 << 20
_MOST_SHOWN = 40  # Characters of an entry of the metadata that a message shows
#: The metadata entry `soilml_kind` of a graph of one step, which other programs feed.
ONE_STEP = "step"
SLIP_STEP = "slip-step"  # The same of a slip filter, which `SlipStream` runs


def released_models() -> dict[str, Path]:
    """The released model files of this installation by their short names.

    They lie in the package, or beside it in a checkout of the project.
    """
    package = Path(__file__).parents[1]
    found: dict[str, Path] = {}
    for folder in (package / "released", package.parent / "exported"):
        for file in sorted(folder.glob("*.onnx")):
            found.setdefault(file.stem, file)
    return found


def find_model(path: str | os.PathLike[str]) -> Path:
    """The file of a path, or the released one of a short name such as "wheel".

    Raises `ModelFileError` for a short name that is neither a file nor released.
    """
    file = Path(path)
    if file.suffix or file.name != str(path) or file.exists():
        return file
    released = released_models()
    if file.name not in released:
        raise ModelFileError(
            f"{file}: no such file, and no released model of this name; "
            f"{did_you_mean(file.name, released)}there are: "
            f"{', '.join(released) or 'none in this installation'}"
        )
    return released[file.name]


def open_model(path: str | os.PathLike[str]) -> tuple[Session, dict[str, str]]:
    """Verify the checksums of a model file and open it: the runtime sees no damaged one.

    Returns: The session, on the CPU with one thread, and all metadata of the file.
    Raises `ModelFileError` for a file that cannot be read, was not written by `soilml train`, has
    another format, or is damaged.
    """
    file = find_model(path)
    content = _read_content(file)
    metadata = _read_metadata(file, content)
    if metadata.get("soilml_kind") == SLIP_STEP:
        raise ModelFileError(
            f"{file} is the slip filter of a rover, for SlipStream; needed is a file that soilml "
            "train wrote"
        )
    if "soilml_format" not in metadata:
        raise ModelFileError(
            f"{file} is an ONNX model without soilml metadata; needed is one that soilml train "
            "wrote"
        )
    # nothing is known yet of these texts: they may be of any length, and of any characters
    if (form := metadata["soilml_format"]) != FORMAT:
        raise ModelFileError(
            f"{file} has format {_shown(form)}; this version of soilml reads format {FORMAT}"
        )
    interface = metadata.get("soilml_interface", "1")
    if interface not in [str(number) for number in range(1, int(INTERFACE) + 1)]:
        raise ModelFileError(
            f"{file} has interface {_shown(interface)}; this version of soilml reads up to "
            f"{INTERFACE}: update soilml"
        )
    if metadata.get("soilml_kind") == ONE_STEP:
        raise ModelFileError(
            f"{file} is one step of a stream, written by soilml export step for other programs; "
            "needed is the file that it was made from"
        )
    return _open_intact(file, content, metadata), metadata


def open_slip_step(path: str | os.PathLike[str], form: str) -> tuple[Session, dict[str, str]]:
    """As `open_model`, for a slip filter in this version of its format."""
    file = Path(path)
    content = _read_content(file)
    metadata = _read_metadata(file, content)
    if metadata.get("soilml_kind") != SLIP_STEP:
        raise ModelFileError(f"{file} is no file of soilml export slip")
    if (found := metadata.get("soilml_format", "1")) != form:
        raise ModelFileError(
            f"{file} has format {_shown(found)} of slip filters; this version of soilml reads "
            f"format {form}: write it again with soilml export slip"
        )
    return _open_intact(file, content, metadata), metadata


def _open_intact(file: Path, content: bytes, metadata: Mapping[str, str]) -> Session:
    if not _is_intact(content, metadata):
        raise ModelFileError(f"{file} is damaged: its checksum does not match; copy it again")
    return _create_session(file, content)


def with_checksums(graph: bytes, metadata: dict[str, str]) -> bytes:
    """The content of a file, from its graph and metadata, to which both checksums are added."""
    metadata["graph_sha256"] = hashlib.sha256(graph).hexdigest()
    metadata["metadata_sha256"] = metadata_checksum(metadata)
    return graph + serialise_metadata(metadata)


def metadata_checksum(metadata: Mapping[str, str]) -> str:
    """SHA-256 of all metadata entries except the checksum itself."""
    entries = sorted((k, v) for k, v in metadata.items() if k != "metadata_sha256")
    return hashlib.sha256(json.dumps(entries).encode()).hexdigest()


def serialise_metadata(metadata: Mapping[str, str]) -> bytes:
    """The metadata as the bytes that follow the graph in the file.

    Entries of `metadata_props` of the protobuf message ModelProto, sorted by key.
    """
    content = b""
    for key, value in sorted(metadata.items()):
        content += _field(_METADATA, _field(1, key.encode()) + _field(2, value.encode()))
    return content


def _field(number: int, content: bytes) -> bytes:
    """A field of a protobuf message: its number and wire type 2, its length, its content."""
    size, length = len(content), bytearray()
    while size > 127:
        length.append(size & 127 | 128)
        size >>= 7
    return bytes((number << 3 | 2, *length, size)) + content


def _is_intact(content: bytes, metadata: Mapping[str, str]) -> bool:
    """Whether the file is exactly the graph and the metadata that were written."""
    tail = serialise_metadata(metadata)
    graph = content.removesuffix(tail)
    return (
        len(graph) + len(tail) == len(content)
        and hashlib.sha256(graph).hexdigest() == metadata.get("graph_sha256")
        and metadata_checksum(metadata) == metadata.get("metadata_sha256")
    )


def _shown(text: str) -> str:
    """A text of an unknown file for a message."""
    return (
        ascii(text)[1:-1] if len(text) <= _MOST_SHOWN else f"{ascii(text[:_MOST_SHOWN])[1:-1]}..."
    )


def _read_content(file: Path) -> bytes:
    try:
        found = file.stat()
        if stat.S_ISREG(found.st_mode) and found.st_size <= MOST_BYTES:
            return file.read_bytes()
    except FileNotFoundError:
        raise ModelFileError(f"{file}: there is no such file") from None
    except OSError as error:
        raise ModelFileError(f"{file} cannot be read: {error.strerror}") from None
    if stat.S_ISDIR(found.st_mode):
        raise ModelFileError(f"{file} cannot be read: {os.strerror(errno.EISDIR)}")
    if not stat.S_ISREG(found.st_mode):
        raise ModelFileError(f"{file} is a device or a pipe; needed is a model file")
    raise ModelFileError(
        f"{file} has {found.st_size / 2**20:.0f} MB; a model file has at most {MOST_BYTES >> 20} MB"
    )


def _read_metadata(file: Path, content: bytes) -> dict[str, str]:
    """The metadata of an ONNX file (field 14 of its message), without the runtime."""
    found: dict[str, str] = {}
    has_graph = False
    try:
        for number, value, first, last in _fields(content, 0, len(content)):
            has_graph |= number == _GRAPH
            if number == _METADATA and value is None:
                entry = {
                    key: content[start:stop]
                    for key, text, start, stop in _fields(content, first, last)
                    if text is None
                }
                found[entry.get(1, b"").decode()] = entry.get(2, b"").decode()
    except ValueError as error:
        raise ModelFileError(f"{file} is not a valid ONNX model: {error}") from None
    if not has_graph:
        raise ModelFileError(f"{file} is not a valid ONNX model: it has no graph")
    return found


def _create_session(file: Path, content: bytes) -> Session:
    try:
        return create_session(content)
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(f"{file} is not a valid ONNX model: {first[:160]}") from None


def create_session(content: bytes) -> Session:
    """A session for the bytes of an ONNX file: on the CPU, with one thread, without messages.

    Raises exceptions of many kinds, which have no public base class, where the bytes are no model.
    """
    if refers_to_files(content):
        raise ValueError("it refers to weights in other files, which its checksums do not cover")
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    return ort.InferenceSession(
        content, options, providers=["CPUExecutionProvider"], enable_fallback=0
    )


def refers_to_files(content: bytes) -> bool:
    """Whether a tensor of the ONNX model is in another file; `ValueError` for what is no model."""
    pending = [("model", 0, len(content))]
    while pending:
        kind, at, end = pending.pop()
        inside = _INSIDE.get(kind)
        for number, value, first, last in _fields(content, at, end):
            if inside is None:  # a tensor
                if number == _EXTERNAL or (number == _LOCATION and value != 0):
                    return True
            elif number in inside:
                if value is not None:
                    raise ValueError("a number where a message is expected")
                pending.append((inside[number], first, last))
    return False


def _fields(content: bytes, at: int, end: int) -> list[tuple[int, int | None, int, int]]:
    """The fields of the protobuf message in these bytes.

    Each has its number, its value where it is a number of variable length, else None, and the
    place where its bytes begin and end. Numbers of one byte, which nearly all are, are read here:
    a file has some ten thousand fields.
    """
    found: list[tuple[int, int | None, int, int]] = []
    while at < end:
        key = content[at]
        at += 1
        if key > 127:
            key, at = _varint(content, at - 1, end)
        wire = key & 7
        if wire == _BYTES:
            size = content[at] if at < end else 128
            at += 1
            if size > 127:
                size, at = _varint(content, at - 1, end)
        elif wire == _VARINT:
            first = at
            value, at = _varint(content, at, end)
            found.append((key >> 3, value, first, at))
            continue
        elif wire in (_EIGHT_BYTES, _FOUR_BYTES):
            size = 8 if wire == _EIGHT_BYTES else 4
        else:
            raise ValueError(f"wire type {wire}")
        if at + size > end:
            raise ValueError("the message ends early")
        found.append((key >> 3, None, at, at + size))
        at += size
    return found


def _varint(content: bytes, at: int, end: int) -> tuple[int, int]:
    """A number of variable length, and the place behind it."""
    value = shift = 0
    while True:
        if at >= end or shift > 63:
            raise ValueError("the message ends early")
        byte = content[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
