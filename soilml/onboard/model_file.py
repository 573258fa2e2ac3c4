"""A model file: its checksums, its metadata, and the session of the ONNX runtime that runs it.

This is the one place where onnxruntime is imported: sessions run on the CPU, without telemetry. A
file that refers to other files, which its checksums do not cover, is refused: the runtime would
read them from the working folder as soon as it opens the model.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias, TypeVar

from soilml.errors import ModelFileError, did_you_mean
from soilml.onboard.set_contract import INTERFACE

# Recent wheels of onnxruntime look up a host of their vendor and write files below the home folder
# as soon as they are imported, unless this is set before.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort

Session: TypeAlias = ort.InferenceSession  # A loaded ONNX file
Opened = TypeVar("Opened")

#: The key by which a tensor names the file that it is in (onnx.proto, TensorProto.external_data),
#: with the last byte of its length before it: the runtime reads no other file without it.
_OF_ANOTHER_FILE = re.compile(rb"[\x00\x08]location")
_METADATA = 14  # Field metadata_props of a model
FORMAT = "3"  # Version of the file format: names of inputs and outputs, keys of the metadata
#: Largest model file, bytes. Those that `soilml train` writes have some MB at most.
MOST_BYTES = 256 << 20
#: What the reading of malformed metadata raises.
DAMAGED = (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError)
_MOST_SHOWN = 40  # Characters of an entry of the metadata that a message shows
#: The metadata entry `soilml_kind` of a slip filter, which `SlipStream` runs.
SLIP_STEP = "slip-step"


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
    """Open a model file and verify its checksums: nothing is computed with a damaged one.

    Returns: The session, on the CPU with one thread, and all metadata of the file.
    Raises `ModelFileError` for a file that cannot be read, was not written by `soilml train`, has
    another format, or is damaged.
    """
    file = find_model(path)
    content = _read_content(file)
    session, metadata = _open(file, content)
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
    _check_intact(file, content, metadata)
    return session, metadata


def open_slip_step(path: str | os.PathLike[str], form: str) -> tuple[Session, dict[str, str]]:
    """As `open_model`, for a slip filter in this version of its format."""
    file = Path(path)
    content = _read_content(file)
    session, metadata = _open(file, content)
    if metadata.get("soilml_kind") != SLIP_STEP:
        raise ModelFileError(f"{file} is no file of soilml export slip")
    if (found := metadata.get("soilml_format", "1")) != form:
        raise ModelFileError(
            f"{file} has format {_shown(found)} of slip filters; this version of soilml reads "
            f"format {form}: write it again with soilml export slip"
        )
    _check_intact(file, content, metadata)
    return session, metadata


def verified(file: Path, read: Callable[[], Opened], passes: Callable[[Opened], bool]) -> Opened:
    """What is read of the metadata of a file, if it reproduces the answers of the file's probe.

    Raises `ModelFileError` for damaged metadata, a file that cannot be run, and a failing probe.
    """
    try:
        found = read()
        passed = passes(found)
    except DAMAGED as error:
        said = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise ModelFileError(f"{file}: its metadata is damaged ({said})") from None
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        raise ModelFileError(f"{file} cannot be run: {' '.join(str(error).split())}") from None
    if not passed:
        raise ModelFileError(f"{file} fails its own probe on this machine: do not use it")
    return found


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


def _check_intact(file: Path, content: bytes, metadata: Mapping[str, str]) -> None:
    """Raise `ModelFileError` unless the file is exactly the graph and metadata as written."""
    graph = content.removesuffix(serialise_metadata(metadata))
    known = metadata.get("graph_sha256"), metadata.get("metadata_sha256")
    if known != (hashlib.sha256(graph).hexdigest(), metadata_checksum(metadata)):
        raise ModelFileError(f"{file} is damaged: its checksum does not match; copy it again")


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


def _open(file: Path, content: bytes) -> tuple[Session, dict[str, str]]:
    """A session and the metadata of a file, which may be damaged."""
    try:
        session = create_session(content)
        return session, dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(
            f"{file} is not a valid ONNX model, or is damaged: {first[:160]}"
        ) from None


def create_session(content: bytes) -> Session:
    """A session for the bytes of an ONNX file: on the CPU, with one thread, without messages.

    Raises exceptions of many kinds, which have no public base class, where the bytes are no model.
    """
    if _OF_ANOTHER_FILE.search(content):
        raise ValueError("it refers to weights in other files, which its checksums do not cover")
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    return ort.InferenceSession(
        content, options, providers=["CPUExecutionProvider"], enable_fallback=0
    )
