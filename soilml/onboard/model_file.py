"""A model file: its checksums, its metadata, and the session that runs it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import ModelFileError, did_you_mean
from soilml.onboard.estimate import PriorSummary
from soilml.onboard.fusion.held_out_errors import HeldOutErrors
from soilml.onboard.gaussian_pooling import PoolingCalibration, RunConditions, RunPattern
from soilml.onboard.session import Session, create_session
from soilml.onboard.set_contract import INTERFACE
from soilml.onboard.set_posterior import SetPosterior

#: Version of the file format: names of inputs and outputs, keys of the metadata.
FORMAT = "3"
#: The metadata entry `soilml_kind` of a graph of one step, which other programs feed.
ONE_STEP = "step"
#: Metadata key of each array of `RunConditions`, and of `RunPattern`.
CONDITION_KEYS = {"lower": "lower", "upper": "upper", "std": "std"}
PATTERN_KEYS = {
    "rows": "rows",
    "worth": "information",
    "widening": "std_scale",
    "reach": "coverage_factor",
}


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
    """Open a model file and verify its checksums.

    Returns
    -------
    session : onnxruntime.InferenceSession
        On the CPU, with one thread.
    metadata : dict of str to str
        All metadata of the file.

    Raises
    ------
    ModelFileError
        For a file that cannot be read, was not written by `soilml train`, has another format, or
        is damaged.
    """
    file = find_model(path)
    content = _read_content(file)
    session, metadata = _create_session(file, content)
    if "soilml_format" not in metadata:
        raise ModelFileError(
            f"{file} is an ONNX model without soilml metadata; needed is one that soilml train "
            "wrote"
        )
    if metadata["soilml_format"] != FORMAT:
        raise ModelFileError(
            f"{file} has format {metadata['soilml_format']}; this version of soilml reads format "
            f"{FORMAT}"
        )
    interface = metadata.get("soilml_interface", "1")
    if not (interface.isdecimal() and int(interface) <= int(INTERFACE)):
        raise ModelFileError(
            f"{file} has interface {interface}; this version of soilml reads up to {INTERFACE}: "
            "update soilml"
        )
    if metadata.get("soilml_kind") == ONE_STEP:
        raise ModelFileError(
            f"{file} is one step of a stream, written by soilml export-step for other programs; "
            "needed is the file that it was made from"
        )
    if not _is_intact(content, metadata):
        raise ModelFileError(f"{file} is damaged: its checksum does not match; copy it again")
    return session, metadata


def metadata_checksum(metadata: Mapping[str, str]) -> str:
    """SHA-256 of all metadata entries except the checksum itself."""
    entries = sorted((k, v) for k, v in metadata.items() if k != "metadata_sha256")
    return hashlib.sha256(json.dumps(entries).encode()).hexdigest()


def serialise_metadata(metadata: Mapping[str, str]) -> bytes:
    """The metadata as the bytes that follow the graph in the file.

    Entries of field 14 (`metadata_props`) of the protobuf message ModelProto, sorted by key.
    """
    content = b""
    for key, value in sorted(metadata.items()):
        content += _field(14, _field(1, key.encode()) + _field(2, value.encode()))
    return content


def read_fields(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Fields of an `Estimator` from the metadata of its file, by field name.

    Raises `KeyError`, `TypeError` or `ValueError` where an entry is missing or malformed.
    """
    inputs, outputs = json.loads(metadata["inputs"]), json.loads(metadata["outputs"])
    _check_provenance(metadata)
    if not all(
        str(entry[key]).isprintable() for entry in (*inputs, *outputs) for key in ("name", "unit")
    ):
        raise ValueError("a name with control characters")
    return {
        "inputs": tuple(entry["name"] for entry in inputs),
        "names": tuple(entry["name"] for entry in outputs),
        "units": tuple(entry["unit"] for entry in outputs),
        "per_row": tuple(entry["name"] for entry in outputs if entry.get("per_row", False)),
        "prior": read_prior(metadata, {}),
        "pooling": read_pooling(json.loads(metadata["together"])),
        "sets": SetPosterior.of(json.loads(metadata["set"])) if "set" in metadata else None,
    }


def read_prior(metadata: Mapping[str, str], context: Mapping[str, float]) -> PriorSummary:
    """The prior of the outputs, where need be scaled by the context value that an output names."""
    outputs = json.loads(metadata["outputs"])
    scale = np.asarray([context.get(entry.get("scale", ""), 1.0) for entry in outputs])
    return PriorSummary(
        *(
            scale * np.asarray([entry[key] for entry in outputs], dtype=np.float64)
            for key in ("prior_mean", "prior_std", "lower", "upper")
        )
    )


def read_probe(metadata: Mapping[str, str]) -> list[dict[str, Any]]:
    """Readings with the answers that the file must reproduce."""
    probe = json.loads(metadata["probe"])
    if not (isinstance(probe, list) and probe):
        raise ValueError("no probe")
    return probe


def read_pooling(entry: Mapping[str, Any]) -> PoolingCalibration:
    """The pooling calibration from the metadata entry "together"."""
    conditions = RunConditions(
        names=tuple(entry["over"]),
        **{field: np.asarray(entry[key], float) for key, field in CONDITION_KEYS.items()},
    )
    patterns = tuple(
        RunPattern(
            varies=tuple(pattern["varies"]),
            **{field: np.asarray(pattern[key], float) for key, field in PATTERN_KEYS.items()},
        )
        for pattern in entry["kinds"]
    )
    return PoolingCalibration(
        conditions=conditions,
        patterns=patterns,
        single_row_coverage_factor=np.asarray(entry["alone"], float),
        inconsistency_limits=np.asarray(entry["doubt"], float),
        held_out=HeldOutErrors.of(entry["held_out"]) if "held_out" in entry else None,
    )


def write_pooling(pooling: PoolingCalibration) -> dict[str, Any]:
    """The metadata entry "together" of a pooling calibration; the inverse of `read_pooling`."""
    conditions = pooling.conditions
    return {
        "over": conditions.names,
        **{key: getattr(conditions, field).tolist() for key, field in CONDITION_KEYS.items()},
        "kinds": [
            {"varies": pattern.varies}
            | {key: getattr(pattern, field).tolist() for key, field in PATTERN_KEYS.items()}
            for pattern in pooling.patterns
        ],
        "alone": pooling.single_row_coverage_factor.tolist(),
        "doubt": pooling.inconsistency_limits.tolist(),
        **({} if pooling.held_out is None else {"held_out": pooling.held_out.entry()}),
    }


def _check_provenance(metadata: Mapping[str, str]) -> None:
    """Raise `ValueError` where the gear or the recipe in the metadata is malformed.

    The runtime does not use them; commands compare them with a user's model file.
    """
    gear, recipe = json.loads(metadata["gear"]), json.loads(metadata["recipe"])
    sizes = [float(gear[name]) for name in ("radius", "width") if name in gear]
    names = [str(effect["name"]) for effect in recipe.get("effect", [])]
    if not (isinstance(gear, dict) and all(size > 0.0 for size in sizes) and all(names)):
        raise ValueError("gear or recipe")


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


def _read_content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise ModelFileError(f"{file}: there is no such file") from None
    except OSError as error:
        raise ModelFileError(f"{file} cannot be read: {error.strerror}") from None


def _create_session(file: Path, content: bytes) -> tuple[Session, dict[str, str]]:
    try:
        session = create_session(content)
        return session, dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(f"{file} is not a valid ONNX model: {first[:160]}") from None
