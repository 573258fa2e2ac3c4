"""Outliers and their confirmation by repeats, and pairs of repeats, on few readings by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml.fitting.coordinates import Coordinate
from soilml.gap.evidence.outliers import OUTLIER_SIGMA, REPEAT_SIGMA, _is_confirmed, outliers
from soilml.gap.evidence.repeats import _worst_pair
from soilml.gap.verdict.entries import _size
from soilml.numerics.prior import Prior


def covariance(matrix):
    matrix = np.asarray(matrix, dtype=float)
    whiten = np.linalg.inv(np.linalg.cholesky(matrix))
    return SimpleNamespace(matrix=matrix, whiten=whiten, std=np.sqrt(np.diag(matrix)))


RUN = np.asarray([0, 0, 0, 1, 1, 1])
ALIKE = np.asarray([0, 1, 0, 0, 2, 3])


def confirmed(residual, matrix=None, run=RUN, scale=1.0):
    """Whether the first reading is confirmed, whose repeats are the third and the fourth."""
    known = covariance(np.eye(6) if matrix is None else matrix)
    residual = np.asarray(residual, dtype=float)
    return _is_confirmed(0, known, residual, residual / known.std / scale, ALIKE, run)


def test_a_repeat_of_another_run_confirms_before_those_of_its_own():
    assert confirmed([9.0, 0.0, 0.0, 8.0, 0.0, 0.0])
    assert not confirmed([9.0, 0.0, 9.0, 0.0, 0.0, 0.0])  # its own run may have the same fault
    one_run = np.zeros(6, dtype=int)
    assert confirmed([9.0, 0.0, 9.0, 0.0, 0.0, 0.0], run=one_run)
    assert not confirmed([9.0, 9.0, 0.0, 0.0, 9.0, 9.0], run=one_run)  # others are no repeats


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_repeat_confirms_on_the_same_side_beyond_three_sigma(sign):
    def found(other, **how):
        return confirmed([sign * 6.0, 0.0, 0.0, sign * other, 0.0, 0.0], **how)

    assert found(REPEAT_SIGMA + 0.1) and not found(REPEAT_SIGMA - 0.1)
    assert not found(-6.0)
    assert found(7.0, scale=2.0) and not found(5.0, scale=2.0)


def test_agreement_counts_what_two_readings_have_in_common():
    """The variance of a difference is the sum of variances less twice the covariance."""
    matrix = np.eye(6) + np.diag([0.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    matrix[0, 3] = matrix[3, 0] = 1.0
    limit = REPEAT_SIGMA * np.sqrt(1.0 + 4.0 - 2.0)
    for apart, agrees in ((limit - 0.1, True), (limit + 0.1, False)):
        assert confirmed([10.0, 0.0, 0.0, 10.0 + apart, 0.0, 0.0], matrix) == agrees


def test_readings_that_fixed_effects_explain_alone_are_no_outliers():
    """The first reading is the only one of a fixed effect: what is left of it is nothing."""
    space = np.zeros((12, 1))
    space[0] = 1.0
    residual = np.asarray([99.0, 5.0, *([0.3, -0.3] * 5)])
    found = outliers(covariance(np.eye(12)), residual, 100.0 * space)
    assert np.flatnonzero(found).tolist() == [1]


@pytest.mark.parametrize("z, stray", [(4.4, False), (4.6, True), (-4.6, True)])
def test_an_outlier_is_beyond_four_and_a_half_sigma(z, stray):
    assert OUTLIER_SIGMA == 4.5
    residual = np.asarray([z, *([0.3, -0.3] * 5)])
    found = outliers(covariance(np.eye(11)), residual, np.zeros((11, 0)))
    assert found.tolist() == [stray] + [False] * 10


def test_a_median_residual_above_the_usual_one_widens_the_limit():
    """Residuals of which half are beyond 1.349 have twice the noise: half of a normal is 0.6745."""
    residual = np.asarray([8.9, *([1.349, -1.349] * 5)])
    known, none = covariance(np.eye(11)), np.zeros((11, 0))
    assert not outliers(known, residual, none).any()
    residual[0] = 9.1
    assert outliers(known, residual, none)[0]


def test_the_worst_pair_is_the_one_that_differs_most_in_sigma():
    alike = np.asarray([0, 0, 0, 1, 1])
    value = np.asarray([0.0, 3.0, 1.0, 0.0, 50.0])
    matrix = np.diag([1.0, 1.0, 1.0, 400.0, 400.0])
    everything = np.ones(5, dtype=bool)
    assert _worst_pair(alike, everything, value, matrix) == (0, 1)
    correlated = matrix.copy()
    correlated[1, 2] = correlated[2, 1] = 0.9
    assert _worst_pair(alike, everything, value, correlated) == (1, 2)
    first = np.asarray([True, False, True, True, True])
    assert _worst_pair(alike, first, value, matrix) == (3, 4)


def test_the_size_of_an_effect_is_its_first_coordinate_or_nothing():
    def coordinate(effect, is_shape=False):
        return Coordinate(f"{effect}.n1", "1", Prior(0.0, 1.0), upper=9.0, is_shape=is_shape)

    fit = SimpleNamespace(
        coordinates=[coordinate("dig"), coordinate("plough"), coordinate("dig", is_shape=True)],
        x=np.asarray([2.5, 3.5, 0.7]),
    )
    assert (_size(fit, "dig"), _size(fit, "plough"), _size(fit, "rate")) == (2.5, 3.5, 0.0)
