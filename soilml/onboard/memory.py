"""What is kept of the readings of one soil, so that a rover can continue where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.features import as_numbers
from soilml.onboard.set_contract import Floats
from soilml.onboard.state_checksum import state_checksum

Singles = NDArray[np.float32]

#: Rows fed to the graph at a time: bounds its working memory, whatever the length of a run.
ROWS_PER_CALL = 256
MEMORY_FORMAT = "3"  # Version of the content of a memory
#: A memory is packed each time that it has grown by so many rows, so that a step takes about as
#: long after thousands of readings as after a few.
PACKED_EVERY = 32
#: Least singular value that is kept, in standard deviations: monomials lie within [-1, 1], so that
#: the sum of squared residuals changes by less than 1e-4.
LEAST_SINGULAR_VALUE = 1e-3


def memory_identity(metadata: Mapping[str, str], context: Mapping[str, float]) -> str:
    """Identity of the memories of a file: version of the content, and what holds for a whole set.

    The latter is wheel, bearing and prior, and the errors that all rows share.
    """
    values = json.dumps(sorted(context.items())).encode()
    return (
        f"{MEMORY_FORMAT}-{metadata['graph_sha256'][:16]}-{hashlib.sha256(values).hexdigest()[:8]}"
    )


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
    checksum : int
        Of all that, as `Estimator.start` and `Estimator.step` wrote it. A memory whose content has
        changed since is refused.
    """

    system: Floats
    counts: Singles
    file: str = ""
    checksum: int = 0

    def sealed(self) -> Memory:
        """This memory with the checksum of its content."""
        parts = np.asarray(self.system, np.float64), np.asarray(self.counts, np.float32)
        return replace(self, checksum=state_checksum(self.file, *parts))

    @property
    def rows(self) -> int:
        """Number of rows that were read."""
        return int(self.counts[1])

    def packed(self, rows_before: int | None = None) -> Memory:
        r"""An equivalent memory of fewer rows, where it has more rows than columns.

        The likelihood depends on the system :math:`A = U S V^T` only through
        :math:`A^T A = (S V^T)^T S V^T`. Rows of :math:`S V^T` whose singular value is below
        `LEAST_SINGULAR_VALUE` change no answer, and are left out: readings of one wheel have
        fewer directions than the system has columns.

        rows_before: Rows of the memory before the last step: it is packed also
            where it has passed a multiple of `PACKED_EVERY` since.

        References
        ----------
        Golub and Van Loan, Matrix Computations, section 2.4.
        """
        rows, columns = self.system.shape
        passed = rows_before is not None and rows // PACKED_EVERY > rows_before // PACKED_EVERY
        if rows <= columns and not passed:
            return self
        _, size, directions = np.linalg.svd(self.system.astype(np.float64), full_matrices=False)
        kept = size > LEAST_SINGULAR_VALUE
        return replace(self, system=size[kept, None] * directions[kept])

    def grown(self, system: Singles, counts: Singles) -> Memory:
        """The memory with the rows that a graph added to its system, and the new counts.

        Only these rows are taken from the graph: the others stay in float64, so that thousands of
        steps do not add up rounding errors.
        """
        added = system[len(self.system) :].astype(np.float64)
        if len(self.system):
            added = np.concatenate([self.system, added])
        return replace(self, system=added, counts=counts)


def check_memory(memory: object, columns: int, identity: str, path: str) -> Memory:
    """The memory; raises `InputError` unless it is one of the file with this identity."""
    begin = "begin with estimator.start()"
    if not isinstance(memory, Memory):
        raise InputError(f"memory is a {type(memory).__name__}; needed is a Memory: {begin}")
    if memory.file != identity:
        raise InputError(
            f"this memory is of {memory.file!r}, which is another file, version, wheel, prior or "
            f"error of sensors than {identity!r} of {path}: {begin}"
        )
    system, counts = (as_numbers("memory", part) for part in (memory.system, memory.counts))
    finite = bool(np.isfinite(system).all() and np.isfinite(counts).all())
    if system.shape[1:] != (columns,) or counts.shape != (3,) or not finite:
        raise InputError(
            f"this memory is damaged: its system has shape {system.shape}; needed are finite "
            f"numbers of shape (rows, {columns}): {begin}"
        )
    if memory.checksum != memory.sealed().checksum:
        raise InputError(f"this memory is damaged: its checksum does not match: {begin}")
    return memory
