"""Nearly known unknowns as errors that all readings share, for a sampler of few points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from operator import mul

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import Value, concat, constant, gemm
from training.set_posterior.monomials import ONE, Terms, derivative
from training.set_posterior.response_surface import Response

#: Sweeps over the linear unknowns, one solved after another, to their likeliest values at a soil.
SWEEPS = 2


@dataclass(frozen=True)
class LinearUnknowns:
    r"""Unknowns z with a normal prior, in which residuals are taken as linear.

    .. math:: r(x, z) \approx A \, b(x, \bar z)
        + \sum_a (z_a - \bar z_a) \, A \frac{\partial b}{\partial z_a}(\bar x, \bar z),
        \qquad z_a \sim N(0, \sigma_a^2)

    with the monomials b. As errors that all readings share they are integrated out, and the other
    unknowns x alone are sampled: a point in three dimensions tells more than one in five. Systems
    are given by their columns (terms, m), as rows.
    """

    terms: Terms
    sampled: Response  # the response in the unknowns x: terms without z
    parts: Floats  # (sampled terms, terms): which terms have which factor without z
    axes: tuple[int, ...]  # numbers of the linear unknowns, counted from 1
    std: Value  # (unknowns, 1) standard deviations of the coordinates

    @staticmethod
    def of(response: Response, free: int, std: Value) -> LinearUnknowns:
        """Of a response whose unknowns after the first `free` are linear."""
        terms = response.terms
        sampled: Terms = tuple(term for term in terms if max(term) <= free)
        parts = np.zeros((len(sampled), len(terms)))
        for column, term in enumerate(terms):
            own = tuple(sorted(factor if factor <= free else ONE for factor in term))
            parts[sampled.index(own), column] = 1.0
        axes = tuple(sorted({factor for term in terms for factor in term if factor > free}))
        return LinearUnknowns(terms, replace(response, terms=sampled), parts, axes, std)

    def in_the_middle(self, columns: Value) -> list[Value]:
        """Columns of x and of z, linear in the middle of the prior's range."""
        middle = constant(columns.graph, np.eye(len(self.terms), 1))
        of_x = [self.terms.index(term) for term in self.sampled.terms]
        return [columns.take(of_x, axis=0), self._changes(middle) @ columns]

    def soil(self, columns: Value, basis: Value) -> tuple[Value, Value]:
        """Monomials (terms, 1) of x and the likeliest z, and z in standard deviations (z, 1).

        basis: Monomials (sampled terms, 1) of x.
        """
        of_x = constant(basis.graph, self.parts.T) @ basis
        unit = constant(basis.graph, np.zeros((len(self.axes), 1)))
        whole = of_x * self._of_z(unit)
        for _ in range(SWEEPS):
            for place in range(len(self.axes)):
                own = np.eye(len(self.axes))[place]
                changes = self._changes(whole) @ columns
                residual = gemm(whole, columns, transpose_a=True)
                change = constant(unit.graph, own[None]) @ changes
                before = unit.take([place], axis=0)
                residual = residual - change * before
                against = gemm(change, residual, transpose_b=True)
                value = -against / (change.sum_of_squares(keepdims=True) + 1.0)
                unit = unit * (1.0 - own)[:, None] + value * own[:, None]
                whole = of_x * self._of_z(unit)
        return whole, unit

    def at(self, columns: Value, whole: Value, unit: Value) -> list[Value]:
        """Columns of x and of z, linear in z at a soil; whole, unit: see `soil`."""
        changes = self._changes(whole) @ columns
        in_x = (self.parts * self._of_z(unit).reshape(1, -1)) @ columns
        first = np.eye(len(self.sampled.terms), 1)
        offset = gemm(unit, changes, transpose_a=True)
        return [gemm(constant(unit.graph, first), offset, in_x, alpha=-1.0), changes]

    def _changes(self, whole: Value) -> Value:
        """Changes (z, terms) of monomials (terms, 1) with one standard deviation of each z."""
        by_axis = [derivative(self.terms, axis) @ whole for axis in self.axes]
        return concat([change.reshape(1, -1) for change in by_axis], axis=0) * self.std.take(
            [a - 1 for a in self.axes], axis=0
        )

    def _of_z(self, unit: Value) -> Value:
        """The factors of z in each term, (terms, 1)."""
        z = unit * self.std.take([axis - 1 for axis in self.axes], axis=0)
        table = concat([constant(unit.graph, [[1.0]]), z], axis=0)
        rows = [
            sorted((self.axes.index(f) + 1 if f in self.axes else 0 for f in term), reverse=True)
            for term in self.terms
        ]
        most = max(sum(factor > 0 for factor in row) for row in rows)
        factors = [table.take([row[k] for row in rows], axis=0) for k in range(most)]
        return reduce(mul, factors)
