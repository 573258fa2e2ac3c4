"""Residuals of a set at sample points, and Gauss-Newton steps, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import mul

import numpy as np
from numpy.typing import NDArray

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

    def step(
        self, points: Value, solved: Value, variance: Value | None = None
    ) -> tuple[Value, Value]:
        """The solved coordinate after a Gauss-Newton step, and its precision, (1, n) each.

        `points` (1 + p, n) lie in the box; the last coordinate is the solved one. `variance`: see
        `gauss_newton`.
        """
        basis = self.basis(points)
        slope = self.slope @ basis.take(self.slope_terms, axis=0)
        return gauss_newton(solved, self.system @ basis, slope, variance)

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


@dataclass(frozen=True)
class ResidualsAtFixedPoints:
    r"""Residuals along the solved coordinate s, at points whose other coordinates are constants.

    .. math:: r(s) = r_0 + r_1 s + A_2 (m \circ s^k), \qquad
        r'(s) = r_1 + A_2 (k m \circ s^{k-1}), \qquad k \ge 2

    with the columns of the system by their power k of s, and the monomials m of the others: the
    products of most columns are the same for all s.
    """

    constant_part: Value  # r_0, (m, n)
    linear_part: Value  # r_1, (m, n)
    higher: Value  # A_2, (m, terms of higher powers)
    higher_slope: Value  # its columns times their powers
    monomials: Floats  # (terms, n) of the other coordinates
    powers: NDArray[np.intp]  # (terms,) of the solved coordinate

    @staticmethod
    def of(residuals: PolynomialResiduals, others: Floats) -> ResidualsAtFixedPoints:
        """At other coordinates (p - 1, n), in their order."""
        solved = residuals.order[-1] + 1
        powers = np.asarray([term.count(solved) for term in residuals.terms])
        points = np.concatenate([others, np.ones_like(others[:1])])[np.argsort(residuals.order)]
        of_others = monomials(points.T, residuals.terms).T
        places = [np.flatnonzero(powers == power) for power in (0, 1)]
        places.append(np.flatnonzero(powers > 1))
        by_power = residuals.system.take(np.concatenate(places).tolist(), axis=1)
        none, one, higher = by_power.split([len(own) for own in places], axis=1)
        return ResidualsAtFixedPoints(
            none @ of_others[places[0]],
            one @ of_others[places[1]],
            higher,
            higher * powers[places[2]],
            of_others,
            powers,
        )

    def steps(self, count: int) -> tuple[Value, Value]:
        """The solved coordinate after so many Gauss-Newton steps from 0, and its precision."""
        zero = constant(self.higher.graph, 0.0)
        solved, precision = gauss_newton(zero, self.constant_part, self.linear_part)
        for _ in range(count - 1):
            slope = gemm(self.higher_slope, self._higher_monomials(solved), self.linear_part)
            solved, precision = gauss_newton(solved, self.residuals(solved), slope)
        return solved, precision

    def residuals(self, solved: Value) -> Value:
        """Residuals (m, n) at solved coordinates (1, n)."""
        linear = self.constant_part + self.linear_part * solved
        return gemm(self.higher, self._higher_monomials(solved) * solved, linear)

    def basis(self, solved: Value) -> Value:
        """Monomials (terms, n) at solved coordinates (1, n)."""
        ones = constant(solved.graph, np.ones((1, self.monomials.shape[1])))
        table = concat([ones, *self._powers(solved, int(self.powers.max()))], axis=0)
        return table.take(self.powers.tolist(), axis=0) * self.monomials

    def _higher_monomials(self, solved: Value) -> Value:
        """Monomials of higher powers k of the solved coordinate with its power k - 1."""
        chosen = self.powers > 1
        table = concat(self._powers(solved, int(self.powers.max()) - 1), axis=0)
        rows = (self.powers[chosen] - 2).tolist()
        return table.take(rows, axis=0) * self.monomials[chosen]

    @staticmethod
    def _powers(solved: Value, last: int) -> list[Value]:
        """The powers 1 to `last` of coordinates (1, n)."""
        found = [solved]
        while len(found) < last:
            found.append(found[-1] * solved)
        return found


def gauss_newton(
    solved: Value, residual: Value, slope: Value, variance: Value | None = None
) -> tuple[Value, Value]:
    r"""A Gauss-Newton step in one unknown, for n points at once.

    .. math:: \kappa = |r'|^2 + \sigma_0^{-2}, \qquad s \leftarrow s - \frac{r^T r'}{\kappa}

    with r the residuals and r' their derivative (m, n), and the damping :math:`\sigma_0`.
    Steps stay within the box.

    variance: That of the noise (1,) over the one of the residuals, where it is not 1.

    Returns: The new s and the precision kappa of its conditional posterior, (1, n) each.
    """
    square = slope.sum_of_squares(axis=0, keepdims=True)
    gradient = (residual * slope).sum(axis=0, keepdims=True)
    if variance is not None:
        square, gradient = square / variance, gradient / variance
    precision = square + DAMPING_STD**-2
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
