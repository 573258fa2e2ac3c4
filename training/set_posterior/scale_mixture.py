"""A likelihood averaged over scales of the model's errors, as nodes of a graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS
from training.onnx_graph.value import Value, concat, constant, exp, gemm, log, sqrt, where
from training.set_posterior.columns import triangular_factor
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.polynomial_residuals import NearlyKnown, PolynomialResiduals


@dataclass(frozen=True)
class PointMisfit:
    """How well points explain the readings."""

    least: Value  # (1, n) sum of squared residuals, with usual errors of the model
    log_likelihood: Value  # (1, n) up to a constant, and as this multiple of it:
    multiple: float

    @staticmethod
    def of_noise_alone(residuals: Value, variance: Value | None = None) -> PointMisfit:
        """Of residuals (m, n) that have this variance (1,), or 1."""
        squares = residuals.sum_of_squares(axis=0, keepdims=True)
        return PointMisfit(squares, squares if variance is None else squares / variance, -2.0)


@dataclass(frozen=True)
class ScaledMisfit(PointMisfit):
    """The same with errors of the model of each scale."""

    parts: Value  # (scales, n) what each adds to the likelihood, over the largest
    total: Value  # (1, n) the sum of these parts


@dataclass(frozen=True)
class OneSystem:
    """Residuals A b(x) of a set whose likelihood is that of standard normal variables."""

    system: Value  # A, (m, terms)

    def misfit(self, basis: Value, variance: Value | None = None) -> PointMisfit:
        """At points with these monomials (terms, n), with noise of this variance (1,), or 1."""
        return PointMisfit.of_noise_alone(self.system @ basis, variance)

    def proposal(self, like: PolynomialResiduals, *_: object) -> PolynomialResiduals:
        """The system for proposals: the same in all rounds."""
        return like


@dataclass(frozen=True)
class ScaleMixture:
    r"""Residuals of a set with errors of the model of each scale integrated out.

    .. math:: p(y | x) = \sum_k p_k |I + s_k^2 E E^T|^{-1/2} \exp(-\tfrac12 |A_k b(x)|^2)

    with the columns E of errors of usual sizes, the scales s_k of the three kinds of errors, and
    their probabilities p_k. The
    determinant is the price of large errors, which readings that need none make them pay.

    References: MacKay, Neural Computation 4(3), 1992 (the determinant as Occam factor).
    """

    systems: Value  # A_k, (scales, m, terms), that of the scale that is judged first
    log_weight: Value  # (scales, 1) logarithms of p_k over the root of the determinant
    count: int  # number of scales
    common: Value | None = None  # further rows (m, terms), which all scales have

    def standardised(self, nearly_known: NearlyKnown | None) -> ScaleMixture:
        """In coordinates of nearly known unknowns, with their prior as further rows."""
        if nearly_known is None:
            return self
        prior = np.broadcast_to(nearly_known.prior, (self.count, *nearly_known.prior.shape))
        whole = [self.systems * nearly_known.factors, constant(self.systems.graph, prior)]
        return replace(self, systems=concat(whole, axis=1))

    def misfit(self, basis: Value, variance: Value | None = None) -> ScaledMisfit:
        """At points with these monomials (terms, n), with noise of this variance (1,), or 1."""
        residuals = self.systems @ basis
        # onnxruntime takes three times as long for sums of squares over the middle of three axes
        squares = (residuals * residuals).sum(axis=1, keepdims=False)
        if self.common is not None:
            squares = squares + (self.common @ basis).sum_of_squares(axis=0, keepdims=True)
        of_squares = -0.5 if variance is None else -0.5 / variance
        log_parts = squares * of_squares + self.log_weight
        largest = log_parts.reduce("ReduceMax", axis=0, keepdims=True)
        parts = exp(log_parts - largest)
        total = parts.sum(axis=0, keepdims=True)
        log_likelihood = log(total) + largest
        return ScaledMisfit(squares.take([0], axis=0), log_likelihood, 1.0, parts, total)

    def proposal(
        self, like: PolynomialResiduals, misfit: PointMisfit, weights: Value
    ) -> PolynomialResiduals:
        """One system for proposals: the mean of all by the posterior of their scales.

        misfit, weights: Of a sample of the posterior, whose weights (1, n) have the sum 1.
        """
        assert isinstance(misfit, ScaledMisfit)
        shares = gemm(weights / misfit.total, misfit.parts, transpose_b=True)  # (1, scales)
        flat = self.systems.reshape(self.count, -1)
        system = (shares @ flat).reshape(-1, len(like.terms))
        if self.common is not None:
            columns = concat([system, self.common], axis=0).node("Transpose")
            system = triangular_factor(columns, len(like.terms))
        return like.with_system(system)


def add_scale_mixture(
    system: Value,
    size: Value,
    terms: int,
    scales: ErrorScales,
    present: Sequence[bool] = (True,) * len(MODEL_ERROR_COLUMNS),
) -> ScaleMixture:
    r"""A system (m, terms + errors) with the errors of the last columns integrated out.

    As `integrate_out_errors` does, for all scales at once. The determinant is the product of that
    of each error, given those that were integrated out before it:

    .. math:: |I + E E^T| = \prod_j (1 + |g_j|^2)

    size: Zero or more: the scale (1,) alone; below zero: `scales`.
    present: Which of `MODEL_ERROR_COLUMNS` the model can have.
    """
    order = np.argsort(np.arange(len(scales.scales)) != scales.judged, kind="stable")
    kept = np.flatnonzero(present)
    of_columns, probabilities = scales.of_columns[order][:, kept], scales.probabilities[order]
    own, columns = system.split([terms, len(present)], axis=1)
    if len(kept) < len(present):
        columns = columns.take(kept.tolist(), axis=1)
    factors = where(size < 0.0, constant(system.graph, of_columns[:, None]), size)
    copies = (own.reshape(1, -1, terms) * np.ones((len(order), 1, 1)), columns * factors)
    systems, determinants = concat(copies, axis=2), []
    for last in range(terms + len(kept) - 1, terms - 1, -1):
        a, g = systems.split([last, 1], axis=2)
        determinant = g.sum_of_squares(axis=1, keepdims=True) + 1.0  # (scales, 1, 1)
        determinants.append(determinant)
        change = g.node("Transpose", perm=[0, 2, 1]) @ a
        systems = a - (g / (determinant + sqrt(determinant))) * change
    log_determinant = log(concat(determinants, axis=1)).sum(axis=1, keepdims=False)
    log_prior = np.log(probabilities)[:, None]
    return ScaleMixture(systems, log_prior - log_determinant * 0.5, len(order))
