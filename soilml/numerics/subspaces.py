"""Column spaces of matrices, and projection onto their orthogonal complements."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats

#: Relative singular value below which a direction is rounding error: a hundred thousand times the
#: double precision, so that only columns that depend linearly on each other are dropped.
ROUNDING = 1e-9


def column_space(
    columns: Floats, *, relative_tolerance: float, absolute_tolerance: float = 0.0
) -> Floats:
    """Orthonormal basis of the column space, by singular value decomposition.

    columns : array (m, k)
    relative_tolerance: Directions with a singular value at or below this fraction of the
        largest are dropped.
    absolute_tolerance: Directions with a singular value at or below this value are dropped
        as well.
    Returns (m, r): Left singular vectors of the r directions that are kept.
    """
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    if s.size == 0:
        return np.asarray(u)
    tolerance = max(relative_tolerance * max(float(s[0]), 1e-300), absolute_tolerance)
    return np.asarray(u[:, s > tolerance])


def project_out(columns: Floats, space: Floats) -> Floats:
    """Component of columns (m, k) that is orthogonal to the column space of `space` (m, p)."""
    if space.shape[1] == 0:
        return columns
    basis = column_space(space, relative_tolerance=ROUNDING)
    return np.asarray(columns - basis @ (basis.T @ columns))
