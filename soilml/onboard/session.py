"""The one place where onnxruntime is imported: sessions on the CPU, and no telemetry."""

from __future__ import annotations

import os
from typing import TypeAlias

# Recent wheels of onnxruntime look up a host of their vendor and write files below the home folder
# as soon as they are imported, unless this is set before.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort

#: A loaded ONNX file.
Session: TypeAlias = ort.InferenceSession


def create_session(content: bytes) -> Session:
    """A session for the bytes of an ONNX file: on the CPU, with one thread, without messages.

    Raises exceptions of many kinds, which have no public base class, where the bytes are no model.
    """
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    return ort.InferenceSession(
        content, options, providers=["CPUExecutionProvider"], enable_fallback=0
    )
