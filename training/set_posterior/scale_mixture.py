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
    r"""A system (m, terms) with errors (m, errors) of the model integrated out, for all scales.

    As `integrate_out` does. The determinant is the product of that of each error, given those that
    were integrated out before it:

    .. math:: |I + E E^T| = \prod_j (1 + |g_j|^2)

    size: Zero or more: the scale (1,) alone; below zero: `scales`.
    present: Which of `MODEL_ERROR_COLUMNS` the model can have, of which the errors are.
    """
    sizes = np.flatnonzero(present)
    of_columns, probabilities = scales.judged_first()
    factors = where(size < 0.0, constant(system.graph, of_columns[:, None, sizes]), size)
    whole = system.node("Unsqueeze", system.indices([0]))
    copies = whole * np.ones((len(probabilities), 1, 1))
    systems, determinants = concat([copies, errors * factors], axis=2), []
    for _ in sizes:
        systems, determinant = composite(
            "IntegrateErrorOfScales", ["without", "determinant"], _without_last_of_scales,
            systems=systems,
        )  # fmt: skip
        determinants.append(determinant)
    log_determinant = log(concat(determinants, axis=1)).sum(axis=1, keepdims=False)
    return Scaled(systems, np.log(probabilities)[:, None] - log_determinant * 0.5)


def _without_last_of_scales(systems: Value) -> list[Value]:
    """As `_without_last`, of systems (scales, m, columns) at once, and the determinants."""
    a, g = systems.last_columns(1)
    determinant = g.sum_of_squares(axis=1, keepdims=True) + 1.0  # (scales, 1, 1)
    change = g.node("Transpose", perm=[0, 2, 1]) @ a
    return [a - (g / (determinant + sqrt(determinant))) * change, determinant]


def integrate_out(system: Value, errors: int) -> Value:
    r"""A system (m, columns) with the errors of its last columns integrated out.

    With g the changes of the residuals with an error that has a normal prior with standard
    deviation 1, the covariance of these residuals is I + g g^T. They are whitened by its symmetric
    square root S:

    .. math:: I + g g^T = S S^T, \qquad A' = S^{-1} A = A - \frac{g}{\kappa} (g^T A), \qquad
        \kappa = 1 + g^T g + (1 + g^T g)^{1/2}

    Several errors are integrated out one after another: the columns of the others are whitened as
    the rest of the system is.
    """
    for _ in range(errors):
        (system,) = composite("IntegrateError", ["without"], _without_last, system=system)
    return system


def _without_last(system: Value) -> list[Value]:
    """A system with the error of the last column integrated out."""
    a, g = system.last_columns(1)
    determinant = gemm(g, g, np.ones((1, 1)), transpose_a=True)
    scaled = g / (determinant + sqrt(determinant))
    return [gemm(scaled, gemm(g, a, transpose_a=True), a, alpha=-1.0)]
