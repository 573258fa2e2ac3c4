"""The Cholesky factor of a small matrix as nodes of a graph: ONNX has no such operator."""

from __future__ import annotations

from training.onnx_graph.value import Value, concat, gemm, sqrt


def cholesky_columns(matrix: Value, count: int) -> Value:
    r"""The first columns of the lower Cholesky factor of a positive definite matrix.

    .. math:: l_k = \frac{M^{(k)} e_k}{\sqrt{M^{(k)}_{kk}}}, \qquad M^{(k+1)} = M^{(k)} - l_k l_k^T

    Parameters
    ----------
    matrix : Value
        Second moments (p, p) of points whose first coordinate is 1, so that its first entry is 1,
        and the first column needs no square root. That column of the factor is the mean of the
        points, and the other columns are the Cholesky factor of their covariance.
    count : int
        Number of columns.

    Returns
    -------
    Value
        The columns (p, count).

    References
    ----------
    Golub and Van Loan, Matrix Computations, section 4.2 (outer-product form).
    """
    columns = []
    for k in range(count):
        index = matrix.indices([k])
        column = matrix.node("Gather", index, axis=1)
        if k:
            column = column / sqrt(column.node("Gather", index, axis=0))
        columns.append(column)
        if k < count - 1:
            matrix = gemm(column, column, matrix, alpha=-1.0, transpose_b=True)
    return concat(columns, axis=1)
