"""The array library that some arrays belong to, so that physics is written once.

Physics in soilml uses only functions of the Python array API standard, so that numpy, torch
and strict test arrays run through the same lines.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from soilml.errors import MissingLibraryError


class NumericArray(Protocol):
    """An array of any library that follows the array API standard, such as numpy or torch.

    The members are those that tell an array from a `str`, a `None` or a list. Operators return
    `Any`, because the libraries differ in what they declare.
    """

    @property
    def shape(self) -> Any: ...
    @property
    def ndim(self) -> int: ...
    @property
    def dtype(self) -> Any: ...
    @property
    def device(self) -> Any: ...

    @property
    def size(self) -> Any: ...

    def __array__(self) -> np.ndarray[Any, Any]: ...
    def __getitem__(self, key: Any, /) -> Any: ...
    def __setitem__(self, key: Any, value: Any, /) -> None: ...
    def __iter__(self) -> Iterator[Any]: ...
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> Any: ...
    def __ne__(self, other: object, /) -> Any: ...
    def __bool__(self) -> bool: ...
    def __float__(self) -> float: ...
    def __int__(self) -> int: ...

    def __neg__(self) -> Any: ...
    def __abs__(self) -> Any: ...
    def __invert__(self) -> Any: ...
    def __add__(self, other: Any, /) -> Any: ...
    def __radd__(self, other: Any, /) -> Any: ...
    def __sub__(self, other: Any, /) -> Any: ...
    def __rsub__(self, other: Any, /) -> Any: ...
    def __mul__(self, other: Any, /) -> Any: ...
    def __rmul__(self, other: Any, /) -> Any: ...
    def __truediv__(self, other: Any, /) -> Any: ...
    def __rtruediv__(self, other: Any, /) -> Any: ...
    def __pow__(self, other: Any, /) -> Any: ...
    def __rpow__(self, other: Any, /) -> Any: ...
    def __and__(self, other: Any, /) -> Any: ...
    def __or__(self, other: Any, /) -> Any: ...
    def __lt__(self, other: Any, /) -> Any: ...
    def __le__(self, other: Any, /) -> Any: ...
    def __gt__(self, other: Any, /) -> Any: ...
    def __ge__(self, other: Any, /) -> Any: ...


#: What a computation returns: an array of the library of its arguments, numpy or torch. Its static
#: type is open, so that callers may pass it on to functions of that library without a cast.
Array: TypeAlias = Any
Real: TypeAlias = float | NumericArray  # What a computation takes: a plain number or an array
#: Arrays of numpy.
Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]


def namespace(*values: Real) -> Any:
    """The array namespace of the first array among `values`; numpy where all are plain numbers."""
    for value in values:
        if isinstance(value, (float, int, np.ndarray, np.generic)):
            continue
        if type(value).__module__.split(".")[0] == "torch":
            try:
                from array_api_compat import torch
            except ImportError:
                raise MissingLibraryError(
                    "torch tensors need array-api-compat: pip install '.[torch]'"
                ) from None
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
