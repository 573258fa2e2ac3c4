"""Cholesky factor of a large kernel matrix, in tiles: half the memory, all cores, the same bits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from soilml.arrays import Floats
from training.regressors.ordered_threads import Progress, ordered_map, thread_count
from training.regressors.rbf_expansion import rbf
from training.regressors.row_groups import Groups

TILE = 512  # Rows of a tile: large enough for matrix products at full speed
LEAST_TILES = 10  # Where there are fewer rows, tiles are smaller


def factor_bytes(rows: int) -> int:
    """Memory of the factor, and of the columns of its inverse that are computed at a time."""
    return 8 * (rows * (rows + 4 * TILE) // 2 + thread_count() * (rows + 4 * TILE) * TILE)


def tiles_of(groups: Groups) -> tuple[Groups, list[slice]]:
    """An order (n,) of rows in which groups are whole and shuffled, and slices of about a tile.

    Each slice has whole groups and at most about a tenth of the rows, for they are left out.
    """
    names, code = np.unique(groups, return_inverse=True)
    place = np.random.default_rng(0).permutation(len(names))[code]
    order = np.argsort(place, kind="stable")
    size = min(TILE, -(-len(groups) // LEAST_TILES))
    ends = np.append(np.flatnonzero(np.diff(place[order])) + 1, len(groups))
    firsts, slices = 0, []
    while firsts < len(groups):
        end = int(ends[min(int(np.searchsorted(ends, firsts + size)), len(ends) - 1)])
        slices.append(slice(firsts, end))
        firsts = end
    return order, slices


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
    def of(
        x: Floats, width: float, gamma: float, slices: list[slice], progress: Progress
    ) -> TiledCholesky:
        """Factorise the kernel matrix of inputs x (n, d), in tiles of these rows."""
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

    def regress(self, y: Floats, progress: Progress) -> tuple[Floats, Floats, Floats]:
        r"""Dual weights (n, q), bias (q,), and estimates (n, q) of each tile's rows without them.

        .. math:: y_B - \hat y_B = (C_{BB})^{-1} \alpha_B, \qquad
            C = H^{-1} - \frac{H^{-1} 1 1^T H^{-1}}{1^T H^{-1} 1}

        for the rows B of a tile, with the factorised matrix H.

        References: Cawley and Talbot, Neural Networks 17(10), 2004, for one row; An, Liu and
        Venkatesh, Pattern Recognition 40, 2007, for several.
        """
        inverse = self.solve(np.column_stack([np.ones(len(y)), y]))
        ones = inverse[:, 0]
        bias = inverse[:, 1:].sum(axis=0) / ones.sum()
        alpha, left_out = inverse[:, 1:] - ones[:, None] * bias, np.empty_like(y)
        blocks = ordered_map(self._inverse_block, range(len(self.slices)))
        for done, (rows, block) in enumerate(zip(self.slices, blocks, strict=True)):
            block -= np.outer(ones[rows], ones[rows]) / ones.sum()
            left_out[rows] = y[rows] - np.linalg.solve(block, alpha[rows])
            progress(done + 1, len(self.slices))
        return alpha, bias, left_out

    def _inverse_block(self, k: int) -> Floats:
        """The block of the inverse on the diagonal: products of a column of tiles of 1 / L."""
        first = self.slices[k].start
        inverse = np.empty((self.slices[-1].stop - first, len(self.inverses[k])))
        inverse[: len(self.inverses[k])] = self.inverses[k]
        for i in range(k + 1, len(self.slices)):
            rows = slice(self.slices[i].start - first, self.slices[i].stop - first)
            products = np.zeros((rows.stop - rows.start, inverse.shape[1]))
            for j in range(k, i):
                above = slice(self.slices[j].start - first, self.slices[j].stop - first)
                products += self.tiles[i][j] @ inverse[above]
            inverse[rows] = self.inverses[i] @ -products
        return np.asarray(inverse.T @ inverse)
