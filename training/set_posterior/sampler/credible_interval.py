"""Quantiles of a weighted sample without sorting, as nodes of a graph."""

from __future__ import annotations

import numpy as np

from training.onnx_graph.value import Value, gemm, maximum

#: Probabilities of the ends of the interval.
INTERVAL = (0.05, 0.95)
#: Distances from the mean, in standard deviations, at which the distribution function is evaluated.
#: The 5 % quantile of a normal distribution lies 1.64 below the mean, that of a uniform one 1.56,
#: and those of an exponential one 0.95 below and 2.0 above; the grid leaves room on both sides of
#: them. All are multiples of their spacing.
SPACING = 0.25
DISTANCES = np.arange(0.5, 3.3, SPACING)
#: Least share of the sample between two grid points that is divided by.
LEAST_SHARE = 1e-6


def add_quantiles(deviations: Value, std: Value, weights: Value, count: int) -> Value:
    r"""The quantiles (q, 2) at `INTERVAL` of q deviations from a mean.

    The weighted distribution function F is evaluated at multiples :math:`g_i` of the spacing h, and
    inverted by linear interpolation. The weight of a sample at :math:`d_j` is shared by the grid
    points around it:

    .. math:: F(g_i) = \sum_j w_j \left[\frac{1}{2} + \frac{g_i - d_j}{h}\right]_0^1

    A sample that counted as a whole on either side of a grid point would move the quantile, by a
    hundredth of a standard deviation and more, when rounding takes it to the other side. Below the
    quantile at probability alpha lie segments that are passed as a whole, and one that is passed in
    part:

    .. math:: Q(\alpha) = g_0 + \sum_i h
        \left[\frac{\alpha - F(g_i)}{F(g_{i+1}) - F(g_i)}\right]_0^1

    A quantile off the grid is at its end. ONNX has no weighted quantile, and sorting each
    parameter's samples would take longer than the rest of the graph.

    Parameters
    ----------
    deviations : Value
        Deviations from the mean, (q, n).
    std : Value
        Their standard deviations, (q, 1).
    weights : Value
        Weights (1, n) with sum 1.
    count : int
        n.
    """
    segments = len(DISTANCES) - 1
    grid = np.concatenate([-DISTANCES[::-1], DISTANCES]) / SPACING
    spacing = std * SPACING
    relative = (deviations / spacing).reshape(0, 1, -1)
    below = ((grid + 0.5)[:, None] - relative).clip(0.0, 1.0)
    flat = below.reshape(-1, count)  # (q * grid points, n)
    # onnxruntime takes half the time for one row times a matrix than for a matrix times one column
    distribution = gemm(weights, flat, transpose_b=True).reshape(-1, len(grid))
    # columns of these matrices are the segments: of the lower half of the grid for the lower
    # quantile, then of the upper half for the upper quantile
    minus_start, increment = np.zeros((2, len(grid), 2 * segments))
    of_end = np.zeros((2 * segments, 2))
    for end in range(2):
        for i in range(segments):
            segment, point = end * segments + i, end * (segments + 1) + i
            minus_start[point, segment] = -1.0
            increment[point, segment], increment[point + 1, segment] = -1.0, 1.0
            of_end[segment, end] = 1.0
    remaining = gemm(distribution, minus_start, np.repeat(INTERVAL, segments))
    passed = remaining / maximum(distribution @ increment, LEAST_SHARE)
    first_points = grid[[0, segments + 1]]
    return gemm(passed.clip(0.0, 1.0), of_end, first_points) * spacing
