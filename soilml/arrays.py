"""The array library that some arrays belong to, so that physics is written once.

Physics in soilml uses only functions of the Python array API standard, so that numpy, torch
and strict test arrays run through the same lines.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, TypeAlias

import numpy as np

#: An array of any library that follows the array API standard.
Array: TypeAlias = Any
#: A plain number or an array.
Real: TypeAlias = Any


def namespace(*values: Real) -> Any:
    """The array namespace of the first array among `values`; numpy where all are plain numbers."""
    for value in values:
        if isinstance(value, (float, int, np.ndarray, np.generic)):
            continue
        if type(value).__module__.split(".")[0] == "torch":
            from array_api_compat import torch

            return torch
        if hasattr(value, "__array_namespace__"):
            return value.__array_namespace__()
    return np


def to_numpy(value: Real) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The values as a float64 numpy array, cut loose from any gradient."""
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    return np.asarray(value, dtype=np.float64)


def requires_gradient(values: Iterable[Real]) -> bool:
    """Whether a gradient is asked for through any of the values."""
    return any(getattr(value, "requires_grad", False) for value in values)


def no_gradient(values: Iterable[Real]) -> AbstractContextManager[object]:
    """A block in which no gradient is recorded, where one is asked for at all."""
    if not requires_gradient(values):
        return nullcontext()
    import torch

    no_grad: AbstractContextManager[object] = torch.no_grad()
    return no_grad
