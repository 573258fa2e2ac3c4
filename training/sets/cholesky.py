"""The Cholesky factor of a small matrix, written out as nodes of a graph: ONNX has none."""

from __future__ import annotations

import numpy as np

from training.graph import Graph


def draw_factor(graph: Graph, matrix: str, p: int) -> str:
    """Lower factor (p, p) of a positive definite matrix (p, p), column by column."""
    op = graph.op
    columns = []
    for k in range(p):
        pick = np.zeros((p, 1), np.float32)
        pick[k] = 1.0
        column = op("MatMul", matrix, graph.small(pick))
        pivot = op("MatMul", graph.small(pick.T), column)
        columns.append(op("Div", column, op("Sqrt", pivot)))
        if k < p - 1:
            matrix = op("Gemm", columns[-1], columns[-1], matrix, alpha=-1.0, transB=1)
    return op("Concat", *columns, axis=1)
