"""Linear systems whose columns are kept as rows: parts are cut out without a copy."""

from __future__ import annotations

import numpy as np

from training.onnx_graph.value import Value, concat, constant, gemm, maximum, sqrt

#: Least squared norm that is divided by: of a column that is zero, or depends on earlier ones.
LEAST_SQUARE = 1e-30


def integrate_out_columns(columns: Value, kept: int, errors: int) -> Value:
    """Columns (kept + errors, m) with the last ones, errors that all readings share, taken out.

    See `integrate_out_errors`, which does the same to the transposed system.
    """
    for last in range(kept + errors - 1, kept - 1, -1):
        others, g = columns.split([last, 1], axis=0)
        determinant = g.sum_of_squares(axis=1, keepdims=True) + 1.0
        scaled = g / (determinant + sqrt(determinant))
        columns = gemm(gemm(others, g, transpose_b=True), scaled, others, alpha=-1.0)
    return columns


def triangular_factor(columns: Value, count: int) -> Value:
    r"""The upper triangular factor R (count, count) of a system whose columns (count, m) are given.

    .. math:: A = Q R, \qquad |A b| = |R b|

    By the modified Gram-Schmidt process, whose factor is as accurate as that of Householder's: the
    system of many readings becomes one of as many rows as it has columns. Squares of the system,
    A^T A, would lose half of the digits of float32.

    References: Bjoerck, BIT 7, 1967 (accuracy of R).
    """
    graph, parts = columns.graph, []
    for first in range(count):
        if first:
            parts.append(constant(graph, np.zeros((first, 1))))
        rest = count - first - 1
        column, others = columns.split([1, rest], axis=0) if rest else (columns, columns)
        length = sqrt(maximum(column.sum_of_squares(axis=1, keepdims=True), LEAST_SQUARE))
        parts.append(length)
        if rest:
            unit = column / length
            along = gemm(others, unit, transpose_b=True)
            parts.append(along)
            columns = gemm(along, unit, others, alpha=-1.0)
    return concat(parts, axis=0).reshape(count, count)
