"""The training domain: where the training rows lie, and what the in-range flag tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.calibration.conditional_bounds import ConditionalBounds
from training.calibration.row_pooling import OPERATING_CONDITIONS
from training.onnx_graph.builder import Graph
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Number of balls, and of the rows that their centres are selected from: more cost time and bytes.
CENTRES = 128
CANDIDATES = 6000
#: Rows whose distances to the centres are computed at a time.
CHUNK = 4096
#: Margin of box and balls, as a share of their size: rows do not reach the very ends of the range.
MARGIN = 0.005


@dataclass(frozen=True)
class TrainingDomain:
    """A box around the training rows' features, conditional bounds, and balls that cover all rows.

    The bounds of measured features depend on slip and load: the box alone would accept a torque
    that no soil gives at this slip. The balls do the same, coarsely, between measured features.
    """

    lower: Floats  # (d,)
    upper: Floats
    scaling: Standardisation
    centres: Floats  # (k, d) standardised
    radius: float
    bounds: tuple[ConditionalBounds, ...]

    @staticmethod
    def of(features: Floats, names: Sequence[str], seed: int = 0) -> TrainingDomain:
        """The domain of features (n, d) with these names.

        Ball centres are selected as farthest points; the radius is the least that covers all rows.
        """
        conditions = tuple(
            i
            for i, name in enumerate(names)
            if name in OPERATING_CONDITIONS and np.ptp(features[:, i]) > 0.0
        )
        measured = set(range(len(names))) - set(conditions) if conditions else ()
        scaling = Standardisation.of(features)
        z = scaling.apply(features)
        candidates = z[np.random.default_rng(seed).permutation(len(z))[:CANDIDATES]]
        selected = [0]
        nearest = np.full(len(candidates), np.inf)
        for _ in range(min(CENTRES, len(candidates)) - 1):
            last = candidates[selected[-1]]
            nearest = np.minimum(nearest, ((candidates - last) ** 2).sum(axis=1))
            selected.append(int(np.argmax(nearest)))
        centres = candidates[selected]
        radius = max(
            float(np.sqrt(_nearest_squared(z[i : i + CHUNK], centres).max()))
            for i in range(0, len(z), CHUNK)
        )
        return TrainingDomain(
            lower=features.min(axis=0) - MARGIN * np.ptp(features, axis=0),
            upper=features.max(axis=0) + MARGIN * np.ptp(features, axis=0),
            scaling=scaling,
            centres=centres,
            radius=radius * (1.0 + MARGIN),
            bounds=tuple(ConditionalBounds.of(features, k, conditions) for k in sorted(measured)),
        )

    def contains(self, features: Floats) -> NDArray[np.bool_]:
        """Whether rows (n, d) lie in the training domain, (n,)."""
        in_box = ((features >= self.lower) & (features <= self.upper)).all(axis=1)
        covered = _nearest_squared(self.scaling.apply(features), self.centres) <= self.radius**2
        within = [bounds.contains(features) for bounds in self.bounds]
        return np.asarray(np.logical_and.reduce([in_box, covered, *within]))

    def add_to_graph(self, graph: Graph, features: str) -> str:
        """Add the same test to an ONNX graph; name of the flag (n,)."""
        outside = graph.op(
            "Or",
            graph.op("Less", features, graph.constant(self.lower)),
            graph.op("Greater", features, graph.constant(self.upper)),
        )
        any_outside = graph.reduced("ReduceMax", graph.double(outside), 1)
        x = graph.scaled(features, self.scaling.mean, self.scaling.scale)
        nearest = graph.reduced("ReduceMin", graph.squared_distances(x, self.centres), 1)
        far = graph.op("Greater", nearest, graph.constant(self.radius**2))
        out = graph.op("Or", graph.op("Greater", any_outside, graph.constant(0.5)), far)
        for bounds in self.bounds:
            out = graph.op("Or", out, bounds.add_outside(graph, features))
        return graph.op("Not", out)


def _nearest_squared(z: Floats, centres: Floats) -> Floats:
    """Squared distance (n,) from rows (n, d) to the nearest centre."""
    squared = (z**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2.0 * (z @ centres.T)
    return np.asarray(np.maximum(squared.min(axis=1), 0.0))
