"""A model file: its checksums, its metadata, and the session that runs it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from soilml.onboard.estimate import PoolingCalibration, RunConditions, RunPattern

Floats = NDArray[np.float64]

#: Version of the file's contract: input and output names, metadata keys.
FORMAT = "3"
#: Keys of what the metadata says of what is driven, and of joining rows in each kind of run.
DRIVEN = ("lower", "upper", "std")
KIND = ("rows", "worth", "widening", "reach")


def opened(path: str | os.PathLike[str]) -> tuple[ort.InferenceSession, dict[str, str]]:
    """The session and the metadata of a file.

    Raises `ModelFileError` for one that is not ours, of another format, or damaged.
    """
    file = Path(path)
    content = _content(file)
    session, metadata = _session(file, content)
    if "soilml_format" not in metadata:
        raise ModelFileError(f"{file} is an ONNX model, but none that soilml train wrote")
    if metadata["soilml_format"] != FORMAT:
        raise ModelFileError(
            f"{file} has format {metadata['soilml_format']}, this soilml reads {FORMAT}"
        )
    if not _whole(content, metadata):
        raise ModelFileError(f"{file} is damaged: its checksum does not hold; export it again")
    return session, metadata


def checksum(metadata: Mapping[str, str]) -> str:
    """Hash of all metadata but the hash itself."""
    entries = sorted((k, v) for k, v in metadata.items() if k != "metadata_sha256")
    return hashlib.sha256(json.dumps(entries).encode()).hexdigest()


def behind(metadata: Mapping[str, str]) -> bytes:
    """The metadata as it stands behind the graph in the file: entries of field 14, by key."""
    found = b""
    for key, value in sorted(metadata.items()):
        entry = _field(1, key.encode()) + _field(2, value.encode())
        found += _field(14, entry)
    return found


def _field(number: int, content: bytes) -> bytes:
    """A field of a protobuf message: its number and wire type 2, its length, its content."""
    size, length = len(content), bytearray()
    while size > 127:
        length.append(size & 127 | 128)
        size >>= 7
    return bytes((number << 3 | 2, *length, size)) + content


def _whole(content: bytes, metadata: Mapping[str, str]) -> bool:
    """Whether the file is the graph and the metadata that were written, and not a byte more."""
    told = behind(metadata)
    graph = content.removesuffix(told)
    return (
        len(graph) + len(told) == len(content)
        and hashlib.sha256(graph).hexdigest() == metadata.get("graph_sha256")
        and checksum(metadata) == metadata.get("metadata_sha256")
    )


def check_origin(metadata: Mapping[str, str]) -> None:
    """Raise where gear and recipe, which commands look into, are not as they are written."""
    gear, recipe = json.loads(metadata["gear"]), json.loads(metadata["recipe"])
    sizes = [float(gear[name]) for name in ("radius", "width") if name in gear]
    names = [str(effect["name"]) for effect in recipe.get("effect", [])]
    if not (isinstance(gear, dict) and all(size > 0.0 for size in sizes) and all(names)):
        raise ValueError("gear or recipe")


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise ModelFileError(f"{file}: there is no such file") from None
    except OSError as error:
        raise ModelFileError(f"{file} cannot be read: {error.strerror}") from None


def _session(file: Path, content: bytes) -> tuple[ort.InferenceSession, dict[str, str]]:
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = ort.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        return session, dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(f"{file} is not a whole ONNX model: {first[:160]}") from None


def together_of(said: dict[str, Any]) -> PoolingCalibration:
    """How rows are joined, as the metadata say it."""
    driven = RunConditions(tuple(said["over"]), *(np.asarray(said[key], float) for key in DRIVEN))
    return PoolingCalibration(
        driven,
        tuple(
            RunPattern(tuple(kind["varies"]), *(np.asarray(kind[key], float) for key in KIND))
            for kind in said["kinds"]
        ),
        np.asarray(said["alone"], float),
        np.asarray(said["doubt"], float),
    )


def numbers(entries: list[dict[str, Any]], key: str) -> Floats:
    """One number of each entry of the metadata, (entries,)."""
    return np.asarray([entry[key] for entry in entries], dtype=np.float64)
