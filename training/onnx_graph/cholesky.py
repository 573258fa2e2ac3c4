"""The Cholesky factor of a small matrix, written out as nodes of a graph: ONNX has none."""

from __future__ import annotations

import numpy as np

from training.onnx_graph.builder import Graph


def draw_factor(graph: Graph, matrix: str, count: int) -> str:
    """First columns (p, count) of the lower factor of a positive definite matrix (p, p).

    The first entry of the matrix is 1: so are moments of points that begin with 1, and the first
    column of the factor is then their mean, the others the factor of their covariance.
    """
    op = graph.op
    columns = []
    for k in range(count):
        pick = graph.constant(np.asarray([k], dtype=np.int64))
        column = op("Gather", matrix, pick, axis=1)
        if k:
            column = op("Div", column, op("Sqrt", op("Gather", column, pick, axis=0)))
        columns.append(column)
        if k < count - 1:
            matrix = op("Gemm", column, column, matrix, alpha=-1.0, transB=1)
    return op("Concat", *columns, axis=1)
