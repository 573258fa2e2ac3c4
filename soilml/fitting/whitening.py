"""What whitens readings that have a smooth discrepancy beside noise and scatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DiscrepancyWhitening:
    r"""A matrix (m, m) that whitens noise, scatter and a discrepancy, as the factors it has.

    .. math:: W = (I - Q S Q^T) W_0, \quad S = \operatorname{diag}(s)

    `noise` is :math:`W_0`, a sparse matrix which many of these share, so that each takes m q
    numbers of memory in place of m^2. `whitening @ x` multiplies arrays (m,) and (m, k).
    """

    noise: Any  # (m, m), a `scipy.sparse.csr_array`
    basis: Floats  # (m, q), with orthonormal columns
    shrinkage: Floats  # (q,)

    def __matmul__(self, values: Floats) -> Floats:
        white = self.noise @ values
        return np.asarray(white - (self.basis * self.shrinkage) @ (self.basis.T @ white))


#: Matrix (m, m), as an array or as its factors.
Whitening: TypeAlias = Floats | DiscrepancyWhitening
