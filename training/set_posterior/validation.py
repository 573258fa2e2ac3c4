"""What a set posterior gives on simulated sets: limits of its misfit, and figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from training.onnx_graph.builder import Graph, session_of
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.misfit_test import MisfitLimits
from training.set_posterior.response_surface import Response
from training.set_posterior.wheel_family import SimulatedSets, WheelFamily

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

#: Sizes of sets, and sets of each, on which the limits are measured and then the figures.
SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
LIMIT_SETS, FIGURE_SETS = 1500, 600
#: Share of sets that the model holds for, and that are refused nonetheless.
FALSE = 0.01


@dataclass(frozen=True)
class SetFigures:
    """Of sets of one size: error over the prior's spread, and what the intervals hold, (q,)."""

    sets: int
    relative: Floats
    cover90: Floats
    joint90: float
    refused: float


def calibrate_misfit_limits(
    family: WheelFamily, response: Response, progress: Progress
) -> SetPosteriorGraph:
    """The set posterior with limits of the misfit that refuse at most one sound set in a hundred.

    The number of readings orders them; torque alone and torque with other channels are measured
    together. Rows that are driven steadily fix no more than one combination of the unknowns: what
    is left of n readings follows a chi-squared distribution of n - 1, and no limit lies below its.
    """
    free = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = posterior_session(SetPosteriorGraph(family, response, free))
    readings, misfit = [], []
    for i, rows in enumerate(SIZES):
        progress("measuring misfit", i, len(SIZES))
        sets = family.sets(LIMIT_SETS, rows, 51)
        for k in range(len(sets.truth)):
            found = graph_outputs(session, response, sets, k)
            readings.append(found["counted_out"][0])
            misfit.append(found["set_misfit"][0])
    progress("measuring misfit", len(SIZES), len(SIZES))
    count, value = np.asarray(readings), np.asarray(misfit)
    knots, limits = [], []
    for size in sorted(set(SIZES) | {48, 64, 96}):
        near = (count > size / 1.13) & (count < size * 1.13)
        if near.sum() >= 300:
            knots.append(float(size))
            steady = chi2.ppf(1.0 - FALSE, size - 1) if size > 1 else 0.0
            limits.append(max(float(np.quantile(value[near], 1.0 - FALSE)), float(steady)))
    rising = np.maximum.accumulate(limits)
    return SetPosteriorGraph(family, response, MisfitLimits(np.asarray(knots), rising))


def validate_posterior(posterior: SetPosteriorGraph, progress: Progress) -> dict[int, SetFigures]:
    """Figures on fresh sets, by rows of a set; a set that is refused counts with the prior."""
    session, found = posterior_session(posterior), {}
    for i, rows in enumerate(SIZES):
        progress("measuring errors", i, len(SIZES))
        sets = posterior.family.sets(FIGURE_SETS, rows, 77)
        answers = [
            graph_outputs(session, posterior.response, sets, k) for k in range(len(sets.truth))
        ]
        mean, low, high, cov = (
            np.stack([a[f"set_{key}"] for a in answers]).astype(np.float64)
            for key in ("mean", "low", "high", "covariance")
        )
        off = sets.truth - mean
        apart = np.einsum("ni,nij,nj->n", off, np.linalg.pinv(cov, hermitian=True), off)
        spread = _spread(posterior.family, sets)
        found[rows] = SetFigures(
            sets=len(off),
            relative=np.sqrt(np.mean((off / spread) ** 2, axis=0)),
            cover90=np.mean((sets.truth >= low) & (sets.truth <= high), axis=0),
            joint90=float(np.mean(apart <= chi2.ppf(0.9, off.shape[1]))),
            refused=1.0 - float(np.mean([a["set_in_range"][0] for a in answers])),
        )
    progress("measuring errors", len(SIZES), len(SIZES))
    return found


def _spread(family: WheelFamily, sets: SimulatedSets) -> Floats:
    """Standard deviation of the prior of each set, (sets, q)."""
    u = (np.arange(4096) + 0.5) / 4096
    own = np.asarray([axis.value(axis.quantile(u)).std() for axis in family.axes[: family.targets]])
    scale = np.ones_like(sets.truth)
    for k, axis in enumerate(family.axes[: family.targets]):
        scale[:, k] = sets.context.get(f"{axis.name}_max", scale[:, k])
    return np.asarray(own * scale)


def posterior_session(posterior: SetPosteriorGraph) -> Any:
    """An onnxruntime session of the set posterior alone."""
    graph = Graph()
    posterior.add_to(graph)
    return session_of(graph.model(posterior.inputs, posterior.outputs))


def graph_outputs(
    session: Any, response: Response, sets: SimulatedSets, index: int
) -> dict[str, Any]:
    """All outputs for one set, by name."""
    feed = {name: values.astype(np.float32) for name, values in sets.rows(index).items()}
    feed |= {
        name: np.asarray([value], np.float32) for name, value in sets.context_of(index).items()
    }
    feed["memory"] = np.zeros((0, len(response.terms) + 1), np.float32)
    feed["counted"] = np.zeros(3, np.float32)
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, feed), strict=True))
