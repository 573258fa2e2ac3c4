"""The training domain: where the training rows lie, and what the in-range flag tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from training.onnx_graph.value import (
    Tensor,
    absolute,
    any_of_row,
    maximum,
    one_column,
    squared_distances,
)
from training.regressors.gaussian_regressor import Standardisation

#: Readings that are operating conditions: the driver sets them, the soil does not.
OPERATING_CONDITIONS = ("slip", "load")
MOST_KNOTS = (24, 8)  # Largest number of knots along the first and the second operating condition
#: Rows per knot, at least, so that the extremes of a cell are close to those of the population.
LEAST_ROWS = 60
#: Margins added to the bounds, as shares of their distance and of their size: of some four standard
#: deviations of usual noise. A genuine reading that is refused costs far more than one that is
#: extrapolated.
BOUNDS_MARGIN, SIZE_MARGIN = 0.02, 0.08


@dataclass(frozen=True)
class ConditionalBounds:
    """Bounds of one column of the features (n, d), given up to two other columns.

    They are interpolated linearly between knots and constant beyond the last knot. Every training
    row lies within them.
    """

    column: int
    conditions: tuple[int, ...]  # columns of the operating conditions
    knots: tuple[Floats, ...]
    lower: Floats  # (k,) or (k1, k2): a value for each knot or pair of knots
    upper: Floats

    @staticmethod
    def of(
        features: Floats, column: int, conditions: tuple[int, ...], slack: float = 0.0
    ) -> ConditionalBounds:
        """The bounds at a knot are the extremes of all rows up to the adjacent knots, and a margin.

        With few rows the number of knots is reduced in proportion along both conditions, and
        `slack` is added to the margin.
        """
        knots_allowed = len(features) / LEAST_ROWS / np.prod(MOST_KNOTS)
        share = min(1.0, knots_allowed ** (1.0 / len(MOST_KNOTS)))
        knots = tuple(
            np.linspace(features[:, k].min(), features[:, k].max(), max(int(most * share), 2))
            for k, most in zip(conditions, MOST_KNOTS, strict=False)
        )
        lower = np.full([len(k) for k in knots], np.inf)
        upper = -lower
        values = features[:, column]
        intervals = [
            np.clip(np.searchsorted(along, features[:, k], "right") - 1, 0, len(along) - 2)
            for k, along in zip(conditions, knots, strict=True)
        ]
        for corner in np.ndindex(*[2] * len(knots)):
            at = tuple(i + step for i, step in zip(intervals, corner, strict=True))
            np.minimum.at(lower, at, values)
            np.maximum.at(upper, at, values)
        empty = ~np.isfinite(lower)
        lower[empty], upper[empty] = values.min(), values.max()
        margin = (BOUNDS_MARGIN + slack) * (upper - lower)
        lower = lower - margin - SIZE_MARGIN * np.abs(lower)
        upper = upper + margin + SIZE_MARGIN * np.abs(upper)
        return ConditionalBounds(column, conditions[: len(knots)], knots, lower, upper)

    def outside(self, features: Tensor) -> Tensor:
        """Whether rows (n, d) lie outside the bounds, (n,)."""
        weights = []
        for k, along in zip(self.conditions, self.knots, strict=True):
            clipped = one_column(features, k).clip(along[0], along[-1])
            distance = (clipped - along) / float(along[1] - along[0])
            weights.append(maximum(1.0 - absolute(distance), 0.0))
        value = one_column(features, self.column).reshape(-1)
        lower, upper = (_interpolated(weights, bound) for bound in (self.lower, self.upper))
        outside: Tensor = (value < lower) | (value > upper)
        return outside


def _interpolated(weights: list[Tensor], bound: Floats) -> Tensor:
    """A bound (n,) from the hat functions (n, k) along one or two conditions."""
    along_first = weights[0] @ bound
    if len(weights) == 1:
        return along_first
    both: Tensor = (along_first * weights[1]).sum(axis=1, keepdims=False)
    return both


#: Number of balls, and of the rows that their centres are selected from: more cost time and bytes.
CENTRES = 128
CANDIDATES = 6000
FEW = 1500  # Rows that gaps between rows are measured on, where few of them are independent
CHUNK = 4096  # Rows whose distances to the centres are computed at a time
#: Margin of box and balls, as a share of their size: rows do not reach the very ends of the range.
MARGIN = 0.02


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
    def of(
        features: Floats, names: Sequence[str], seed: int = 0, few: bool = False
    ) -> TrainingDomain:
        """The domain of features (n, d) with these names.

        Ball centres are selected as farthest points; the radius is the least that covers all rows.
        With `few` rows, extremes and distances of further rows are larger: each end of a range is
        moved by two expected gaps between rows, and balls reach from any row to its nearest one.
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
            float(np.sqrt(squared_distances(z[i : i + CHUNK], centres).min(axis=1).max()))
            for i in range(0, len(z), CHUNK)
        )
        slack = 2.0 / (len(z) + 1.0) if few else 0.0
        if few:
            radius = max(radius, _largest_gap(candidates[:FEW]))
        margin = (MARGIN + slack) * np.ptp(features, axis=0)
        return TrainingDomain(
            lower=features.min(axis=0) - margin,
            upper=features.max(axis=0) + margin,
            scaling=scaling,
            centres=centres,
            radius=radius * (1.0 + MARGIN),
            bounds=tuple(
                ConditionalBounds.of(features, k, conditions, slack) for k in sorted(measured)
            ),
        )

    def contains(self, features: Tensor) -> Tensor:
        """Whether rows (n, d), of an array or an ONNX graph, lie in the training domain, (n,)."""
        out = any_of_row((features < self.lower) | (features > self.upper))
        x = (features - self.scaling.mean) / self.scaling.scale
        out = out | (squared_distances(x, self.centres).min(axis=1) > self.radius**2)
        for bounds in self.bounds:
            out = out | bounds.outside(features)
        inside: Tensor = ~out
        return inside


def _largest_gap(z: Floats) -> float:
    """Largest distance of a row of z (n, d) to the nearest different one, times 1.5."""
    squared = ((z[:, None, :] - z[None, :, :]) ** 2).sum(axis=2)
    squared[squared == 0.0] = np.inf  # a row itself, and the same readings again
    nearest = squared.min(axis=1)
    return float(np.sqrt(nearest.max(where=np.isfinite(nearest), initial=0.0))) * 1.5
