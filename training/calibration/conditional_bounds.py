"""Bounds of a measured feature that follow what is driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph

Floats = NDArray[np.float64]

#: Knots along what is driven, at most; rows that a knot needs; slack, as a share of the width.
KNOTS = (24, 8)
LEAST_ROWS = 60
SLACK = 0.02


@dataclass(frozen=True)
class ConditionalBounds:
    """Bounds of one column of the features (n, d), between knots along up to two other columns.

    Between knots they are interpolated linearly, beyond the last they stay. No row that it was made
    of lies outside.
    """

    column: int
    driven: tuple[int, ...]
    knots: tuple[Floats, ...]
    lower: Floats  # one value for each knot, or pair of knots
    upper: Floats

    @staticmethod
    def of(features: Floats, column: int, driven: tuple[int, ...]) -> ConditionalBounds:
        """A knot's bounds are those of all rows between its neighbours, and a little slack."""
        share = min(1.0, (len(features) / LEAST_ROWS / np.prod(KNOTS)) ** (1.0 / len(KNOTS)))
        knots = tuple(
            np.linspace(features[:, k].min(), features[:, k].max(), max(int(most * share), 2))
            for k, most in zip(driven, KNOTS, strict=False)
        )
        lower = np.full([len(k) for k in knots], np.inf)
        upper = -lower
        values = features[:, column]
        cells = [
            np.clip(np.searchsorted(along, features[:, k], "right") - 1, 0, len(along) - 2)
            for k, along in zip(driven, knots, strict=True)
        ]
        for corner in np.ndindex(*[2] * len(knots)):
            at = tuple(cell + step for cell, step in zip(cells, corner, strict=True))
            np.minimum.at(lower, at, values)
            np.maximum.at(upper, at, values)
        empty = ~np.isfinite(lower)
        lower[empty], upper[empty] = values.min(), values.max()
        slack = SLACK * (upper - lower)
        return ConditionalBounds(column, driven[: len(knots)], knots, lower - slack, upper + slack)

    def holds(self, features: Floats) -> NDArray[np.bool_]:
        """Whether rows (n, d) lie within the bounds, (n,)."""
        weights = [
            _tents(features[:, k], along) for k, along in zip(self.driven, self.knots, strict=True)
        ]
        lower, upper = (_between(weights, bound) for bound in (self.lower, self.upper))
        values = features[:, self.column]
        return np.asarray((values >= lower) & (values <= upper))

    def draw(self, graph: Graph, features: str) -> str:
        """Whether a row lies outside the bounds, (n,), as a node of an ONNX graph."""
        weights = []
        for k, along in zip(self.driven, self.knots, strict=True):
            ends = [graph.constant(end) for end in (along[0], along[-1])]
            kept = graph.op("Clip", graph.columns(features, k, k + 1), *ends)
            apart = graph.scaled(kept, along, along[1] - along[0])
            near = graph.op("Sub", graph.constant(1.0), graph.op("Abs", apart))
            weights.append(graph.op("Max", near, graph.constant(0.0)))
        value = graph.reshaped(graph.columns(features, self.column, self.column + 1), -1)
        ends = [
            graph.op(kind, value, _drawn(graph, weights, bound))
            for kind, bound in (("Less", self.lower), ("Greater", self.upper))
        ]
        return graph.op("Or", *ends)


def _tents(values: Floats, knots: Floats) -> Floats:
    """Weights (n, k) of the knots in linear interpolation."""
    kept = np.clip(values, knots[0], knots[-1])
    apart = (kept[:, None] - knots) / (knots[1] - knots[0])
    return np.asarray(np.maximum(1.0 - np.abs(apart), 0.0))


def _between(weights: list[Floats], bound: Floats) -> Floats:
    found = weights[0] @ bound
    return np.asarray(found if len(weights) == 1 else (found * weights[1]).sum(axis=1))


def _drawn(graph: Graph, weights: list[str], bound: Floats) -> str:
    found = graph.op("MatMul", weights[0], graph.constant(bound))
    if len(weights) == 1:
        return found
    return graph.reduced("ReduceSum", graph.op("Mul", found, weights[1]), 1)
