"""What is kept of the readings of one soil, so that a rover can continue where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.features import as_numbers

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

#: Version of the content of a memory.
MEMORY_FORMAT = "1"


def memory_identity(metadata: Mapping[str, str], context: Mapping[str, float]) -> str:
    """Identity of the memories of a file for what holds for a whole set.

    That is wheel, bearing and prior, and the errors that all rows share, which are part of the
    rows in the memory.
    """
    values = json.dumps(sorted(context.items())).encode()
    return f"{metadata['graph_sha256'][:16]}-{hashlib.sha256(values).hexdigest()[:8]}"


@final
@dataclass(frozen=True)
class Memory:
    """Sufficient statistics of the readings so far: a linear system and three counts.

    Parameters
    ----------
    system : ndarray of float64
        Residual system (k, columns) of the readings; k is at most the number of columns, however
        many readings there were.
    counts : ndarray of float32
        Informative readings, rows, and rows in range, (3,).
    file : str
        Which file, wheel and prior the memory is of: `Estimator.memory_id`.
    format : str
        Version of the content.
    """

    system: Floats
    counts: Singles
    file: str = ""
    format: str = MEMORY_FORMAT

    @property
    def rows(self) -> int:
        """Number of rows that were read."""
        return int(self.counts[1])

    def packed(self) -> Memory:
        """An equivalent memory, with the triangular factor of a longer system in its place.

        The likelihood depends on the system A only through A^T A = R^T R, with R its triangular
        factor (Golub and Van Loan, Matrix Computations, section 5.3).
        """
        if len(self.system) <= self.system.shape[1]:
            return self
        factor: Any = np.linalg.qr(self.system.astype(np.float64), mode="r")
        return replace(self, system=factor)

    def grown(self, system: Singles, counts: Singles) -> Memory:
        """The memory with the rows that a graph added to its system, and the new counts.

        Only these rows are taken from the graph: the others stay in float64, so that thousands of
        steps do not add up rounding errors.
        """
        added = system[len(self.system) :].astype(np.float64)
        return replace(self, system=np.concatenate([self.system, added]), counts=counts)


def check_memory(memory: object, columns: int, identity: str, path: str) -> Memory:
    """The memory; raises `InputError` unless it is one of the file with this identity."""
    begin = "begin with estimator.start()"
    if not isinstance(memory, Memory):
        raise InputError(f"memory is a {type(memory).__name__}; needed is a Memory: {begin}")
    if memory.format != MEMORY_FORMAT:
        raise InputError(
            f"this memory has format {memory.format!r}; this version of soilml reads format "
            f"{MEMORY_FORMAT!r}: {begin}"
        )
    if memory.file != identity:
        raise InputError(
            f"this memory is of {memory.file!r}, which is another file, wheel, prior or error of "
            f"sensors than {identity!r} of {path}: {begin}"
        )
    system, counts = (as_numbers("memory", part) for part in (memory.system, memory.counts))
    finite = bool(np.isfinite(system).all() and np.isfinite(counts).all())
    if system.shape[1:] != (columns,) or counts.shape != (3,) or not finite:
        raise InputError(
            f"this memory is damaged: its system has shape {system.shape}; needed are finite "
            f"numbers of shape (rows, {columns}): {begin}"
        )
    return memory
