"""Projection of vectors onto the orthogonal complement of a column space."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats

#: Relative singular value below which a direction is rounding error: a hundred thousand times the
#: double precision, so that only columns that depend linearly on each other are dropped.
ROUNDING = 1e-9


def project_out(columns: Floats, space: Floats) -> Floats:
    """Component of columns (m, k) that is orthogonal to the column space of `space` (m, p)."""
    if space.shape[1] == 0:
        return columns
    u, s, _ = np.linalg.svd(space, full_matrices=False)
    basis = u[:, s > ROUNDING * s.max(initial=1e-300)]
    return np.asarray(columns - basis @ (basis.T @ columns))
