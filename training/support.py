"""Where the training rows lie: the base of every in-range flag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.graph import Graph
from training.scaling import Scaling

Floats = NDArray[np.float64]

COVERS = 128
POOL = 6000


@dataclass(frozen=True)
class Support:
    """A box around the rows' features, and balls around some of them that hold all of them.

    The box alone would call a torque that no soil gives at this slip in range.
    """

    lower: Floats  # (d,)
    upper: Floats
    scaling: Scaling
    covers: Floats  # (k, d) standardised
    radius: float

    @staticmethod
    def of(features: Floats, seed: int = 0) -> Support:
        """Balls by farthest-point selection; the radius is the least that holds every row."""
        scaling = Scaling.of(features)
        z = scaling.apply(features)
        pool = z[np.random.default_rng(seed).permutation(len(z))[:POOL]]
        chosen = [0]
        nearest = np.full(len(pool), np.inf)
        for _ in range(min(COVERS, len(pool)) - 1):
            nearest = np.minimum(nearest, ((pool - pool[chosen[-1]]) ** 2).sum(axis=1))
            chosen.append(int(np.argmax(nearest)))
        covers = pool[chosen]
        radius = max(
            float(np.sqrt(_least(z[i : i + 4096], covers).max())) for i in range(0, len(z), 4096)
        )
        return Support(features.min(axis=0), features.max(axis=0), scaling, covers, radius)

    def holds(self, features: Floats) -> NDArray[np.bool_]:
        """Whether rows (n, d) lie where the training rows lie, (n,)."""
        boxed = ((features >= self.lower) & (features <= self.upper)).all(axis=1)
        near = _least(self.scaling.apply(features), self.covers) <= self.radius**2
        return np.asarray(boxed & near)

    def draw(self, graph: Graph, features: str) -> str:
        """The flag (n,) as a node of an ONNX graph."""
        outside = graph.op(
            "Or",
            graph.op("Less", features, graph.constant(self.lower)),
            graph.op("Greater", features, graph.constant(self.upper)),
        )
        beyond = graph.reduced("ReduceMax", graph.double(outside), 1)
        x = graph.scaled(features, self.scaling.mean, self.scaling.scale)
        apart = graph.reduced("ReduceMin", graph.squared_distances(x, self.covers), 1)
        far = graph.op("Greater", apart, graph.constant(self.radius**2))
        return graph.op(
            "Not", graph.op("Or", graph.op("Greater", beyond, graph.constant(0.5)), far)
        )


def _least(z: Floats, covers: Floats) -> Floats:
    apart = (z**2).sum(axis=1)[:, None] + (covers**2).sum(axis=1) - 2.0 * (z @ covers.T)
    return np.asarray(np.maximum(apart.min(axis=1), 0.0))
