"""A likelihood averaged over scales of the model's errors, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from training.onnx_graph.value import Value, concat, constant, exp, gemm, log, sqrt, where
from training.set_posterior.columns import triangular_factor
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.polynomial_residuals import NearlyKnown, PolynomialResiduals


@dataclass(frozen=True)
class ScaledMisfit:
    """How well points explain the readings."""

    surprise: Value  # (1, n) -2 log likelihood up to a constant, averaged over scales
    least: Value  # (1, n) sum of squared residuals with usual errors of the model
    log_parts: Value  # (scales, n) logarithms of what each scale adds to the likelihood


@dataclass(frozen=True)
class ScaleMixture:
    r"""Residuals of a set with errors of the model of each scale integrated out.

    .. math:: p(y | x) = \sum_k p_k |I + s_k^2 E E^T|^{-1/2} \exp(-\tfrac12 |A_k b(x)|^2)

    with the columns E of errors of usual sizes, the scales s_k of the three kinds of errors, and
    their probabilities p_k. The
    determinant is the price of large errors, which readings that need none make them pay.

    References: MacKay, Neural Computation 4(3), 1992 (the determinant as Occam factor).
    """

    systems: Value  # A_k, (scales, m, terms), by rising scale
    log_weight: Value  # (scales, 1) logarithms of p_k over the root of the determinant
    scales: ErrorScales
    common: Value | None = None  # further rows (m, terms), which all scales have

    @property
    def count(self) -> int:
        """Number of scales."""
        return len(self.scales.scales)

    def standardised(self, nearly_known: NearlyKnown | None) -> ScaleMixture:
        """In coordinates of nearly known unknowns, with their prior as further rows."""
        if nearly_known is None:
            return self
        prior = np.broadcast_to(nearly_known.prior, (self.count, *nearly_known.prior.shape))
        whole = [self.systems * nearly_known.factors, constant(self.systems.graph, prior)]
        return replace(self, systems=concat(whole, axis=1))

    def divided_by(self, std: Value) -> ScaleMixture:
        """For noise whose standard deviation is larger by a factor (1,)."""
        common = None if self.common is None else self.common / std
        return replace(self, systems=self.systems / std, common=common)

    def misfit(self, basis: Value) -> ScaledMisfit:
        """At points with these monomials (terms, n)."""
        squares = (self.systems @ basis).sum_of_squares(axis=1, keepdims=False)
        if self.common is not None:
            squares = squares + (self.common @ basis).sum_of_squares(axis=0, keepdims=True)
        log_parts = squares * -0.5 + self.log_weight
        largest = log_parts.reduce("ReduceMax", axis=0, keepdims=True)
        total = log(exp(log_parts - largest).sum(axis=0, keepdims=True)) + largest
        least = squares.take([self.scales.judged], axis=0)
        return ScaledMisfit(total * -2.0, least, log_parts - total)

    def proposal(
        self, like: PolynomialResiduals, misfit: ScaledMisfit, weights: Value
    ) -> PolynomialResiduals:
        """One system for proposals: the mean of all by the posterior of their scales.

        misfit, weights: Of a sample of the posterior, whose weights (1, n) have the sum 1.
        """
        shares = gemm(weights, exp(misfit.log_parts), transpose_b=True)  # (1, scales)
        flat = self.systems.reshape(self.count, -1)
        system = (shares @ flat).reshape(-1, len(like.terms))
        if self.common is not None:
            columns = concat([system, self.common], axis=0).node("Transpose")
            system = triangular_factor(columns, len(like.terms))
        return like.with_system(system)


def add_scale_mixture(system: Value, size: Value, terms: int, scales: ErrorScales) -> ScaleMixture:
    r"""A system (m, terms + errors) with the errors of the last columns integrated out.

    As `integrate_out_errors` does, for all scales at once. The determinant is the product of that
    of each error, given those that were integrated out before it:

    .. math:: |I + E E^T| = \prod_j (1 + |g_j|^2)

    size: Zero or more: the scale (1,) alone; below zero: `scales`.
    scales: By rising size.
    """
    of_columns = scales.of_columns
    count, errors = of_columns.shape
    own, columns = system.split([terms, errors], axis=1)
    factors = where(size < 0.0, constant(system.graph, of_columns[:, None]), size)
    copies = (own.reshape(1, -1, terms) * np.ones((count, 1, 1)), columns * factors)
    systems, determinants = concat(copies, axis=2), []
    for last in range(terms + errors - 1, terms - 1, -1):
        a, g = systems.split([last, 1], axis=2)
        determinant = g.sum_of_squares(axis=1, keepdims=True) + 1.0  # (scales, 1, 1)
        determinants.append(determinant)
        change = g.node("Transpose", perm=[0, 2, 1]) @ a
        systems = a - (g / (determinant + sqrt(determinant))) * change
    log_determinant = log(concat(determinants, axis=1)).sum(axis=1, keepdims=False)
    log_prior = np.log(scales.probabilities)[:, None]
    return ScaleMixture(systems, log_prior - log_determinant * 0.5, scales)
