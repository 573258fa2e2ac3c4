"""Cholesky factor of a large kernel matrix, in tiles: half the memory, all cores, the same bits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from soilml.arrays import Floats
from training.regressors.ordered_threads import Progress, ordered_map, thread_count
from training.regressors.rbf_expansion import rbf

TILE = 512  # Rows of a tile: large enough for matrix products at full speed


def factor_bytes(rows: int) -> int:
    """Memory of the factor, and of the columns of its inverse that are computed at a time."""
    return 8 * (rows * (rows + TILE) // 2 + thread_count() * (rows + 2 * TILE) * TILE)


@dataclass(frozen=True)
class TiledCholesky:
    r"""The factor L of :math:`\Omega + I / \gamma = L L^T`, its lower tiles only.

    Every tile is computed by one thread in a fixed order of operations: the result does not depend
    on the number of threads.
    """

    tiles: list[list[Floats]]  # row i has the tiles 0 ... i, without the one on the diagonal
    inverses: list[Floats]  # of the tiles on the diagonal
    slices: list[slice]  # rows of each row of tiles

    @staticmethod
    def of(x: Floats, width: float, gamma: float, progress: Progress) -> TiledCholesky:
        """Factorise the kernel matrix of inputs x (n, d)."""
        slices = [slice(i, min(i + TILE, len(x))) for i in range(0, len(x), TILE)]
        count = len(slices)
        found = TiledCholesky([[] for _ in slices], [], slices)

        def column(k: int, i: int) -> Floats:
            """The tile (i, k) less the products of the columns to its left."""
            tile = rbf(x[slices[i]], x[slices[k]], width)
            for a, b in zip(found.tiles[i], found.tiles[k], strict=False):
                tile -= a @ b.T
            return tile

        def below(k: int, i: int) -> Floats:
            return np.asarray(column(k, i) @ found.inverses[k].T)

        for k in range(count):
            diagonal = column(k, k)
            diagonal[np.diag_indices(len(diagonal))] += 1.0 / gamma
            factor, failed = dpotrf(diagonal, lower=1)
            if failed:
                raise np.linalg.LinAlgError("the kernel matrix is not positive definite")
            found.inverses.append(np.ascontiguousarray(dtrtri(factor, lower=1)[0]))
            rows = range(k + 1, count)
            for i, tile in zip(rows, ordered_map(partial(below, k), rows), strict=True):
                found.tiles[i].append(tile)
            progress(k + 1, count)
        return found

    def solve(self, right: Floats) -> Floats:
        """The solution (n, q) of the system with right-hand sides (n, q)."""
        y = np.array(right, dtype=np.float64)
        for i, rows in enumerate(self.slices):
            for tile, earlier in zip(self.tiles[i], self.slices, strict=False):
                y[rows] -= tile @ y[earlier]
            y[rows] = self.inverses[i] @ y[rows]
        for i in reversed(range(len(self.slices))):
            rows = self.slices[i]
            y[rows] = self.inverses[i].T @ y[rows]
            for tile, earlier in zip(self.tiles[i], self.slices, strict=False):
                y[earlier] -= tile.T @ y[rows]
        return y

    def inverse_diagonal(self, progress: Progress) -> Floats:
        """The diagonal (n,) of the inverse of the system: sums of squares over columns of 1 / L."""
        count = len(self.slices)

        def column(k: int) -> Floats:
            """The sums for the columns of one column of tiles of the inverse factor."""
            first = self.slices[k].start
            inverse = np.empty((self.slices[-1].stop - first, len(self.inverses[k])))
            inverse[: len(self.inverses[k])] = self.inverses[k]
            for i in range(k + 1, count):
                rows = slice(self.slices[i].start - first, self.slices[i].stop - first)
                products = np.zeros((rows.stop - rows.start, inverse.shape[1]))
                for j in range(k, i):
                    above = slice(self.slices[j].start - first, self.slices[j].stop - first)
                    products += self.tiles[i][j] @ inverse[above]
                inverse[rows] = self.inverses[i] @ -products
            return np.asarray(np.einsum("ij,ij->j", inverse, inverse))

        parts = []
        for done, part in enumerate(ordered_map(column, range(count))):
            parts.append(part)
            progress(done + 1, count)
        return np.concatenate(parts)
