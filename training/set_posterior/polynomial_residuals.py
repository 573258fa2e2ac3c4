"""Residuals of a set at sample points, and Gauss-Newton steps, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import mul

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import Value, concat, constant, exp, gemm, log
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.monomials import Terms, derivative, monomials, pair_factors
from training.set_posterior.response_surface import Response

#: Its inverse square is added to the curvature along the solved coordinate: it damps the step, and
#: is the width of the proposal, where readings do not constrain the coordinate. A little more than
#: the standard deviation of the uniform prior on [-1, 1], 0.58.
DAMPING_STD = 0.7


def order_of_axes(family: WheelFamily) -> tuple[int, ...]:
    """The axes in the order in which they are sampled: the last is solved for."""
    names = [axis.name for axis in family.axes]
    solved = names.index("friction_angle") if "friction_angle" in names else 0
    return *(i for i in range(len(names)) if i != solved), solved


@dataclass(frozen=True)
class PolynomialResiduals:
    """Residuals A b(x) (m, n) of a set at points x.

    A point is a column of (1 + p, n): 1, and the coordinates within [-1, 1], in an order of the
    axes in which the one that is solved for is last.
    """

    system: Value  # A, (m, terms)
    slope: Value  # of the derivative along the solved axis, (m, fewer terms)
    slope_terms: tuple[int, ...]  # numbers of its terms
    terms: Terms
    order: tuple[int, ...]

    @staticmethod
    def of(
        family: WheelFamily, response: Response, nearly_known: NearlyKnown | None, system: Value
    ) -> PolynomialResiduals:
        """Of a system (m, terms); solved for the friction angle if it is unknown.

        Torque follows the friction angle almost linearly, so that one Gauss-Newton step comes
        close.
        """
        if nearly_known is not None:
            system = nearly_known.standardised(system)
        return PolynomialResiduals.solved_last(system, response.terms, order_of_axes(family))

    @staticmethod
    def solved_last(system: Value, terms: Terms, order: tuple[int, ...]) -> PolynomialResiduals:
        """Of a system (m, terms) in an order of the axes whose last is solved for."""
        # each monomial's derivative is a multiple of one other monomial
        by_solved = derivative(terms, order[-1] + 1)
        rows, columns = np.nonzero(by_solved)
        slope = system.take(rows.tolist(), axis=1) * by_solved[rows, columns]
        return PolynomialResiduals(system, slope, tuple(columns.tolist()), terms, order)

    def with_system(self, system: Value) -> PolynomialResiduals:
        """The residuals of another system (m, terms)."""
        return PolynomialResiduals.solved_last(system, self.terms, self.order)

    def divided_by(self, std: Value) -> PolynomialResiduals:
        """For noise whose standard deviation is larger by a factor (1,)."""
        return self.with_system(self.system / std)

    def at_fixed_points(self, points: Floats) -> tuple[Value, Value]:
        """Residuals and their derivative (m, n) at fixed coordinates (p, n), in this order."""
        basis = monomials(points[np.argsort(self.order)].T, self.terms).T
        return self.system @ basis, self.slope @ basis[list(self.slope_terms)]

    def step(self, points: Value, solved: Value) -> tuple[Value, Value]:
        """The solved coordinate after a Gauss-Newton step, and its precision, (1, n) each.

        `points` (1 + p, n) lie in the box; the last coordinate is the solved one.
        """
        basis = self.basis(points)
        slope = self.slope @ basis.take(self.slope_terms, axis=0)
        return gauss_newton(solved, self.system @ basis, slope)

    def basis(self, points: Value) -> Value:
        """Monomials (terms, n) at points (1 + p, n), as products of pairs of coordinates."""
        row_of = [0, *(1 + self.order.index(i) for i in range(len(self.order)))]
        factors = pair_factors(self.terms)
        pairs = sorted({pair for term in factors for pair in term})
        left, right = (points.take([row_of[pair[k]] for pair in pairs], axis=0) for k in (0, 1))
        table = left * right
        per_term = [
            table.take([pairs.index(term[k]) for term in factors], axis=0)
            for k in range(len(factors[0]))
        ]
        return reduce(mul, per_term)


def gauss_newton(solved: Value, residual: Value, slope: Value) -> tuple[Value, Value]:
    r"""A Gauss-Newton step in one unknown, for n points at once.

    .. math:: \kappa = |r'|^2 + \sigma_0^{-2}, \qquad s \leftarrow s - \frac{r^T r'}{\kappa}

    with r the residuals and r' their derivative (m, n), and the damping :math:`\sigma_0`.
    Steps stay within the box.

    Returns: The new s and the precision kappa of its conditional posterior, (1, n) each.
    """
    precision = slope.sum_of_squares(axis=0, keepdims=True) + DAMPING_STD**-2
    gradient = (residual * slope).sum(axis=0, keepdims=True)
    return within_box(solved - gradient / precision), precision


def within_box(x: Value) -> Value:
    """Coordinates limited to [-1, 1]."""
    return x.clip(-1.0, 1.0)


@dataclass(frozen=True)
class NearlyKnown:
    r"""Standardised coordinates of nearly known unknowns, which have a normal prior.

    With :math:`z = x / (c \sigma)`, c the truncation in standard deviations, the coefficient of a
    monomial is multiplied by :math:`(c \sigma)^k` for its power k of the coordinate, and the prior
    is the residual :math:`c z`. All coordinates then lie between -1 and 1.
    """

    factors: Value  # (1, terms)
    prior: Floats  # (nearly known unknowns, terms) residuals

    @staticmethod
    def of(family: WheelFamily, response: Response, context: ContextValues) -> NearlyKnown | None:
        """Of a family; None where nothing is nearly known."""
        unknowns, free, terms = len(family.axes), family.free, response.terms
        if context.axis_std is None:
            return None
        powers = np.asarray(
            [[term.count(axis) for term in terms] for axis in range(1, unknowns + 1)]
        )
        powers[:free] = 0
        log_std = log(context.axis_std * NORMAL_TRUNCATION)
        padding = (0,) * (len(terms[0]) - 1)
        linear = [terms.index((*padding, axis)) for axis in range(free + 1, unknowns + 1)]
        return NearlyKnown(
            exp(gemm(log_std, powers, transpose_a=True)),
            NORMAL_TRUNCATION * np.eye(len(terms))[linear],
        )

    def standardised(self, system: Value) -> Value:
        """A system (m, terms) in standardised coordinates, with the prior as further rows."""
        return concat([system * self.factors, constant(system.graph, self.prior)], axis=0)
