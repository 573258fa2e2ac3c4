"""A likelihood averaged over scales of the model's errors, as composites of a graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from training.onnx_graph.value import (
    Value,
    composite,
    concat,
    constant,
    either_of,
    exp,
    gemm,
    log,
    sqrt,
    where,
)
from training.set_posterior.error_scales import ErrorScales


class PointMisfit(NamedTuple):
    """How well points explain the readings."""

    least: Value  # (1, n) sum of squared residuals, with usual errors of the model
    log_likelihood: Value  # (1, n) up to a constant
    parts: Value  # (scales, n) what each scale adds to the likelihood, over the largest
    total: Value  # (1, n) the sum of these parts


@dataclass(frozen=True)
class Scaled:
    r"""Residuals of a set with errors of the model of each scale integrated out.

    .. math:: p(y | x) = \sum_k p_k |I + s_k^2 E E^T|^{-1/2} \exp(-\tfrac12 |A_k b(x)|^2)

    with the columns E of errors of usual sizes, the scales s_k of the three kinds of errors, and
    their probabilities p_k. The determinant is the price of large errors, which readings that need
    none make them pay.

    References: MacKay, Neural Computation 4(3), 1992 (the determinant as Occam factor).
    """

    systems: Value  # A_k, (scales, m, terms), that of the scale that is judged first
    log_weight: Value  # (scales, 1) logarithms of p_k over the root of the determinant

    def misfit(self, basis: Value, variance: Value) -> PointMisfit:
        """At points with these monomials (terms, n), with noise of this variance (1,)."""

        def body(systems: Value, log_weight: Value, basis: Value, variance: Value) -> list[Value]:
            residuals = systems @ basis
            # onnxruntime takes three times as long for sums of squares over the middle axis
            squares = (residuals * residuals).sum(axis=1, keepdims=False)
            log_parts = squares * (-0.5 / variance) + log_weight
            largest = log_parts.reduce("ReduceMax", axis=0, keepdims=True)
            parts = exp(log_parts - largest)
            total = parts.sum(axis=0, keepdims=True)
            return [squares.take([0], axis=0), log(total) + largest, parts, total]

        given = {"systems": self.systems, "log_weight": self.log_weight}
        found = composite(
            "Misfit", PointMisfit._fields, body, **given, basis=basis, variance=variance
        )
        return PointMisfit(*found)

    def mean(self, misfit: PointMisfit, weights: Value) -> Value:
        """One system (m, terms) for proposals: the mean of all by the posterior of their scales.

        misfit, weights: Of a sample of the posterior, whose weights (1, n) have the sum 1.
        """

        def body(systems: Value, parts: Value, total: Value, weights: Value) -> list[Value]:
            shares = gemm(weights / total, parts, transpose_b=True)  # (1, scales)
            return [(systems * shares.reshape(-1, 1, 1)).sum(axis=0, keepdims=False)]

        given = {"systems": self.systems, "parts": misfit.parts, "total": misfit.total}
        return composite("MeanOfScales", ["system"], body, **given, weights=weights)[0]


def scale_mixture(
    system: Value, errors: Value, size: Value, scales: ErrorScales, present: Sequence[bool]
) -> Scaled:
    r"""A system (1, m, terms) with errors (1, m, errors) of the model integrated out, by scale.

    The determinant is the product of that of each error, given those that were integrated out
    before it:

    .. math:: |I + E E^T| = \prod_j (1 + |g_j|^2)

    size: Zero or more: the scale (1,) alone; below zero: `scales`. Zero leaves the system as it is.
    present: Which of `MODEL_ERROR_COLUMNS` the model can have, of which the errors are.
    """
    sizes = np.flatnonzero(present)
    of_columns, probabilities = scales.judged_first()

    def integrated() -> list[Value]:
        factors = where(size < 0.0, constant(system.graph, of_columns[:, None, sizes]), size)
        copies = system * np.ones((len(probabilities), 1, 1))
        whole = concat([copies, errors * factors], axis=2)
        systems, determinants = integrate_out(whole, len(sizes))
        log_determinant = log(concat(determinants, axis=1)).sum(axis=1, keepdims=False)
        return [systems, np.log(probabilities)[:, None] - log_determinant * 0.5]

    def alone() -> list[Value]:
        return [system, constant(system.graph, np.zeros((1, 1)))]

    return Scaled(*either_of(size * size > 0.0, integrated, alone))


def integrate_out(systems: Value, errors: int) -> tuple[Value, list[Value]]:
    r"""Systems (n, m, columns) with the errors of their last columns integrated out.

    With g the changes of the residuals with an error that has a normal prior with standard
    deviation 1, the covariance of these residuals is I + g g^T. They are whitened by its symmetric
    square root S:

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \frac{g}{\kappa} (g^T A), \qquad
        \kappa = 1 + g^T g + (1 + g^T g)^{1/2}

    Several errors are integrated out one after another: the columns of the others are whitened as
    the rest of the system is.

    Returns: The systems, and of each error the determinants 1 + g^T g, (n, 1, 1).
    """
    determinants = []
    for number in range(errors):
        systems, determinant = composite(
            "IntegrateError", ["whitened", "determinant"], _whitened,
            systems=systems, column=systems.indices([-1 - number]),
        )  # fmt: skip
        determinants.append(determinant)
    return systems.last_columns(errors)[0] if errors else systems, determinants


def _whitened(systems: Value, column: Value) -> list[Value]:
    """Systems whitened by the error of one column, which means nothing then, and determinants."""
    g = systems.node("Gather", column, axis=2)
    determinant = g.sum_of_squares(axis=1, keepdims=True) + 1.0
    change = g.node("Transpose", perm=[0, 2, 1]) @ systems
    return [systems - (g / (determinant + sqrt(determinant))) * change, determinant]
