"""Calibration and validation of a set posterior on simulated sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from datagen.engines.processes import process_map
from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    ERROR_COLUMNS,
    MEMORY_INPUTS,
    OPERATING_STD_INPUTS,
    empty_memory,
)
from training.onnx_graph.builder import Graph, session_of
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.response_surface import Response
from training.set_posterior.sampler.misfit_test import MisfitLimits
from training.set_posterior.sampler.posterior_summary import prior_summary

Floats = NDArray[np.float64]
T = TypeVar("T")
Progress = Callable[[str, int, int], None]

#: Rows of the sets, and the number of sets of each size for calibration and for validation.
SET_SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
LIMIT_SETS, FIGURE_SETS = 1500, 600
#: Seeds of both; the released files depend on them.
LIMIT_SEED, FIGURE_SEED = 51, 77
#: Share of consistent sets that are refused.
FALSE_ALARM_RATE = 0.01
#: Limits are calibrated at these numbers of readings; the larger ones occur with three channels.
READING_COUNTS = sorted(set(SET_SIZES) | {48, 64, 96})
#: Sets whose number of readings differs by up to this factor count towards a limit, of which there
#: must be enough for a quantile of one in a hundred.
NEIGHBOUR_FACTOR, LEAST_NEIGHBOURS = 1.13, 300


@dataclass(frozen=True)
class SetFigures:
    """Accuracy for sets of one size.

    Parameters
    ----------
    sets : int
        Number of sets.
    relative : ndarray
        RMSE over the standard deviation of the prior, (q,).
    cover90 : ndarray
        Coverage of the 90 % intervals, (q,).
    joint90 : float
        Coverage of the 90 % ellipsoid of mean and covariance.
    refused : float
        Share of sets that were refused; they count with the prior.
    """

    sets: int
    relative: Floats
    cover90: Floats
    joint90: float
    refused: float


def calibrate_misfit_limits(
    family: WheelFamily, response: Response, progress: Progress
) -> SetPosteriorGraph:
    """The set posterior with misfit limits that refuse at most one consistent set in a hundred."""
    no_limits = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    task = partial(_misfits, SetPosteriorGraph(family, response, no_limits))
    found = _by_size(task, "measuring misfit", progress)
    readings, misfit = (np.concatenate(part) for part in zip(*found.values(), strict=True))
    return SetPosteriorGraph(family, response, misfit_limits(readings, misfit))


def _misfits(posterior: SetPosteriorGraph, rows: int) -> tuple[Floats, Floats]:
    """Number of readings (sets,) and misfit (sets,) of simulated sets of one size."""
    session = posterior_session(posterior, ("counted_out", "set_misfit"))
    sets = posterior.family.sets(LIMIT_SETS, rows, LIMIT_SEED)
    found = [graph_outputs(session, posterior.response, sets, k) for k in range(len(sets.truth))]
    readings, misfit = ([one[key][0] for one in found] for key in ("counted_out", "set_misfit"))
    return np.asarray(readings), np.asarray(misfit)


def _by_size(task: Callable[[int], T], text: str, progress: Progress) -> dict[int, T]:
    """Results of a task for each size of sets, on all cores; the longest are begun first."""
    found = {}
    with process_map(task, SET_SIZES[::-1]) as results:
        for done, (rows, result) in enumerate(zip(SET_SIZES[::-1], results, strict=True)):
            progress(text, done, len(SET_SIZES))
            found[rows] = result
    progress(text, len(SET_SIZES), len(SET_SIZES))
    return {rows: found[rows] for rows in SET_SIZES}


def misfit_limits(readings: Floats, misfit: Floats) -> MisfitLimits:
    """Limits by number of readings from the misfits (sets,) of consistent sets.

    Limits depend on the number of readings, whatever their channels. Rows at one operating
    condition determine one combination of the unknowns only: the misfit of n readings then follows
    a chi-squared distribution with n - 1 degrees of freedom, and no limit is below the quantile of
    that. A soil in the middle of the prior fits a single reading exactly, one at its end does not:
    what noise adds to the reading there has one degree of freedom.
    """
    knots, limits = [], []
    for size in READING_COUNTS:
        neighbours = (readings > size / NEIGHBOUR_FACTOR) & (readings < size * NEIGHBOUR_FACTOR)
        if neighbours.sum() >= LEAST_NEIGHBOURS:
            knots.append(float(size))
            one_condition = chi2.ppf(1.0 - FALSE_ALARM_RATE, max(size - 1, 1))
            quantile = np.quantile(misfit[neighbours], 1.0 - FALSE_ALARM_RATE)
            limits.append(max(float(quantile), float(one_condition)))
    return MisfitLimits(np.asarray(knots), np.maximum.accumulate(limits))


def validate_posterior(posterior: SetPosteriorGraph, progress: Progress) -> dict[int, SetFigures]:
    """Accuracy on independent sets, by rows of a set; refused sets count with the prior."""
    return _by_size(partial(_figures, posterior), "measuring errors", progress)


def _figures(posterior: SetPosteriorGraph, rows: int) -> SetFigures:
    """Accuracy on simulated sets of one size."""
    session = posterior_session(posterior)
    sets = posterior.family.sets(FIGURE_SETS, rows, FIGURE_SEED)
    outputs = [graph_outputs(session, posterior.response, sets, k) for k in range(len(sets.truth))]
    mean, low, high, cov = (
        np.stack([a[f"set_{key}"] for a in outputs]).astype(np.float64)
        for key in ("mean", "low", "high", "covariance")
    )
    error = sets.truth - mean
    precision = np.linalg.pinv(cov, hermitian=True)
    mahalanobis = np.einsum("ni,nij,nj->n", error, precision, error)  # squared
    prior_std = _prior_std(posterior.family, sets)
    return SetFigures(
        sets=len(error),
        relative=np.sqrt(np.mean((error / prior_std) ** 2, axis=0)),
        cover90=np.mean((sets.truth >= low) & (sets.truth <= high), axis=0),
        joint90=float(np.mean(mahalanobis <= chi2.ppf(0.9, error.shape[1]))),
        refused=1.0 - float(np.mean([a["set_in_range"][0] for a in outputs])),
    )


def _prior_std(family: WheelFamily, sets: SimulatedSets) -> Floats:
    """Standard deviation of the prior of each set, (sets, q)."""
    scale = np.ones_like(sets.truth)
    for k, axis in enumerate(family.axes[: family.targets]):
        scale[:, k] = sets.context.get(f"{axis.name}_max", scale[:, k])
    return np.asarray(prior_summary(family)["std"] * scale)


def posterior_session(posterior: SetPosteriorGraph, outputs: Sequence[str] = ()) -> Any:
    """An onnxruntime session of a graph that has the set posterior only.

    With `outputs`, it computes these alone, to the same bits in less time.
    """
    graph = Graph()
    posterior.add_to(graph)
    wanted = {name: posterior.outputs[name] for name in outputs or posterior.outputs}
    return session_of(graph.model(posterior.inputs, wanted))


def graph_outputs(
    session: Any,
    response: Response,
    sets: SimulatedSets,
    index: int,
    errors: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """All outputs of the session for one simulated set without memory, by name.

    Slip and load are taken as exact, and `COMMON_ERROR_INPUTS` as 0 where `errors` lacks them.
    """
    rows = sets.rows(index)
    feed = {name: np.zeros(len(rows["slip"]), np.float32) for name in OPERATING_STD_INPUTS}
    common = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0) | dict(errors or {})
    feed |= {name: np.asarray([std], np.float32) for name, std in common.items()}
    feed |= {name: values.astype(np.float32) for name, values in rows.items()}
    feed |= {
        name: np.asarray([value], np.float32) for name, value in sets.context_of(index).items()
    }
    feed |= dict(
        zip(MEMORY_INPUTS, empty_memory(len(response.terms) + len(ERROR_COLUMNS)), strict=True)
    )
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, feed), strict=True))
