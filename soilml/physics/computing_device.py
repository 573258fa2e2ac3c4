"""The device that solves numpy rows: this processor by numpy, or one that torch sees."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from soilml.errors import InputError, MissingLibraryError
from soilml.parameters import mapped
from soilml.physics.contact import Force
from soilml.physics.load_case import LoadCase

T = TypeVar("T")

#: Rows that a GPU solves together: enough to fill it, in about one gigabyte of its memory.
DEVICE_CHUNK = 1 << 18
#: Name of the device; None for numpy.
_DEVICE: ContextVar[str | None] = ContextVar("computing_device", default=None)


def current_device() -> str | None:
    """The device that `computing_on` has set, or None."""
    return _DEVICE.get()


@contextmanager
def computing_on(device: str) -> Iterator[None]:
    """Within it, models solve numpy rows by torch on a device, and give numpy arrays back.

    device: As torch names it: "cuda", "cuda:1"; "cpu" solves by torch on this processor.

    Raises `InputError` where torch has no such device or it lacks float64, or its memory does not
    suffice; `MissingLibraryError` where torch is not installed.
    """
    try:
        import torch
    except ImportError:
        raise MissingLibraryError("a device needs torch: pip install '.[torch]'") from None
    try:
        torch.zeros(1, dtype=torch.float64, device=device)
    except (RuntimeError, AssertionError, TypeError) as error:
        reason = str(error).splitlines()[0]
        count = torch.cuda.device_count()
        seen = ", ".join(["cpu", *(f"cuda:{i}" for i in range(count))])
        raise InputError(
            f"torch cannot compute on the device {device!r} ({reason}); it sees: {seen}"
        ) from None
    token = _DEVICE.set(device)
    try:
        yield
    except torch.OutOfMemoryError:
        raise InputError(
            f"the memory of {device} does not suffice: end what else uses it, or omit --device; "
            "files that are complete stay"
        ) from None
    finally:
        _DEVICE.reset(token)


def to_device(load_case: LoadCase, device: str) -> LoadCase:
    """The load case with arrays of this device."""
    import torch

    return mapped(load_case, lambda v: torch.as_tensor(v, dtype=torch.float64, device=device))


def from_device(force: Force) -> Force:
    """Forces as numpy arrays."""
    parts: dict[str, Any] = {f.name: getattr(force, f.name) for f in fields(Force)}
    return Force(**{n: np.asarray(v.detach().cpu().numpy()) for n, v in parts.items()})
