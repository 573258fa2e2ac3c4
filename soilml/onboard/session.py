"""The one place where onnxruntime is imported: sessions on the CPU, and no telemetry.

A file that refers to other files, which its checksums do not cover, is refused: the runtime would
read them from the working folder as soon as it opens the model. Whether it does is read from its
protobuf messages, of which only those on the way to a tensor are opened (onnx.proto, IR version 3
to 11).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TypeAlias

# Recent wheels of onnxruntime look up a host of their vendor and write files below the home folder
# as soon as they are imported, unless this is set before.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort

#: A loaded ONNX file.
Session: TypeAlias = ort.InferenceSession

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
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5


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
    pending = [("model", memoryview(content))]
    while pending:
        kind, message = pending.pop()
        for number, value in _fields(message):
            if kind == "tensor":
                if number == _EXTERNAL or (number == _LOCATION and value != 0):
                    return True
            elif (inner := _INSIDE[kind].get(number)) is not None:
                if isinstance(value, int):
                    raise ValueError("a number where a message is expected")
                pending.append((inner, value))
    return False


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview | int]]:
    """(number, content) of each field of a protobuf message."""
    at, end = 0, len(message)
    while at < end:
        key, at = _varint(message, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, at = _varint(message, at)
            yield number, value
            continue
        if wire == _BYTES:
            size, at = _varint(message, at)
        elif wire in (_EIGHT_BYTES, _FOUR_BYTES):
            size = 8 if wire == _EIGHT_BYTES else 4
        else:
            raise ValueError(f"wire type {wire}")
        if at + size > end:
            raise ValueError("the message ends early")
        yield number, message[at : at + size]
        at += size


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number of variable length, and the place behind it."""
    value = shift = 0
    while True:
        if at >= len(message) or shift > 63:
            raise ValueError("the message ends early")
        byte = message[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
