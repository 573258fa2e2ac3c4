"""Where the training rows lie: the base of every in-range flag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.calibration.conditional_bounds import ConditionalBounds
from training.calibration.recalibration import DRIVEN
from training.onnx_graph.builder import Graph
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

COVERS = 128
POOL = 6000
#: Slack of the box, as a share of its width: the rows do not reach its very ends.
SLACK = 0.005


@dataclass(frozen=True)
class TrainingDomain:
    """A box around the rows' features, bounds within it, and balls that hold all of the rows.

    The bounds of what is measured follow slip and load; the box alone would call a torque that no
    soil gives at this slip in range. The balls do the same, coarsely, between measured features.
    """

    lower: Floats  # (d,)
    upper: Floats
    scaling: Standardisation
    covers: Floats  # (k, d) standardised
    radius: float
    envelopes: tuple[ConditionalBounds, ...]

    @staticmethod
    def of(features: Floats, names: Sequence[str], seed: int = 0) -> TrainingDomain:
        """Balls by farthest-point selection; the radius is the least that holds every row."""
        driven = tuple(
            i for i, n in enumerate(names) if n in DRIVEN and np.ptp(features[:, i]) > 0.0
        )
        measured = set(range(len(names))) - set(driven) if driven else ()
        scaling = Standardisation.of(features)
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
        return TrainingDomain(
            lower=features.min(axis=0) - SLACK * np.ptp(features, axis=0),
            upper=features.max(axis=0) + SLACK * np.ptp(features, axis=0),
            scaling=scaling,
            covers=covers,
            radius=radius * (1.0 + SLACK),
            envelopes=tuple(ConditionalBounds.of(features, k, driven) for k in sorted(measured)),
        )

    def holds(self, features: Floats) -> NDArray[np.bool_]:
        """Whether rows (n, d) lie where the training rows lie, (n,)."""
        boxed = ((features >= self.lower) & (features <= self.upper)).all(axis=1)
        near = _least(self.scaling.apply(features), self.covers) <= self.radius**2
        bound = [envelope.holds(features) for envelope in self.envelopes]
        return np.asarray(np.logical_and.reduce([boxed, near, *bound]))

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
        out = graph.op("Or", graph.op("Greater", beyond, graph.constant(0.5)), far)
        for envelope in self.envelopes:
            out = graph.op("Or", out, envelope.draw(graph, features))
        return graph.op("Not", out)


def _least(z: Floats, covers: Floats) -> Floats:
    apart = (z**2).sum(axis=1)[:, None] + (covers**2).sum(axis=1) - 2.0 * (z @ covers.T)
    return np.asarray(np.maximum(apart.min(axis=1), 0.0))
