"""The Cholesky factor in tiles, against that of the whole matrix."""

import numpy as np
import pytest

from training.regressors.rbf_expansion import rbf
from training.regressors.tiled_cholesky import TILE, TiledCholesky


def no_progress(done, total):
    pass


@pytest.mark.parametrize("rows", [40, 2 * TILE, 2 * TILE + 77])
def test_solution_and_diagonal_of_the_inverse_are_those_of_the_whole_matrix(rows):
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(rows, 3)), rng.normal(size=(rows, 2))
    factor = TiledCholesky.of(x, 0.8, 30.0, no_progress)
    inverse = np.linalg.inv(rbf(x, x, 0.8) + np.eye(rows) / 30.0)
    np.testing.assert_allclose(factor.solve(y), inverse @ y, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(
        factor.inverse_diagonal(no_progress), np.diag(inverse), rtol=1e-9, atol=1e-11
    )
