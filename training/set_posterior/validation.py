"""Calibration and validation of a set posterior, and what its file and card say of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from scipy.stats import chi2

from soilml.arrays import Floats
from soilml.onboard.set_contract import (
    ABSENT_STD,
    COMMON_ERROR_INPUTS,
    ERROR_COLUMNS,
    LEAST_SHARE_IN_RANGE,
    MEMORY_INPUTS,
    OPERATING_STD_INPUTS,
    RESPONSE_CHANNELS,
    empty_memory,
)
from soilml.processes import process_map
from training.onnx_graph.builder import Graph, session_of
from training.set_posterior.families.wheel_family import SimulatedSets
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.posterior_summary import INTERVAL, MisfitLimits, prior_summary
from training.set_posterior.response_surface import Response

Progress = Callable[[str, int, int], None]

T = TypeVar("T")

#: Rows of the sets, and the number of sets of each size for calibration and for validation.
SET_SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
LIMIT_SETS, FIGURE_SETS = 1500, 600
LIMIT_SEED, FIGURE_SEED = 51, 77  # Seeds of both; the released files depend on them
FALSE_ALARM_RATE = 0.01  # Share of sound sets whose misfit is above the limit of a file
#: Limits are calibrated at these numbers of readings; the larger ones occur with three channels.
READING_COUNTS = sorted(set(SET_SIZES) | {48, 64, 96})
#: Sets whose number of readings differs by up to this factor count towards a limit, of which there
#: must be enough for a quantile of one in a hundred.
NEIGHBOUR_FACTOR, LEAST_NEIGHBOURS = 1.13, 300


@dataclass(frozen=True)
class SetFigures:
    """Accuracy for sets of one size."""

    sets: int  # number of sets
    relative: Floats  # RMSE over the standard deviation of the prior, (q,)
    cover90: Floats  # coverage of the 90 % intervals, (q,)
    joint90: float  # coverage of the 90 % ellipsoid of mean and covariance
    refused: float  # share of sets that were refused; they count with the prior


#: Of a set posterior before its limits are measured.
NO_LIMITS = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))


def with_misfit_limits(posterior: SetPosteriorGraph, progress: Progress) -> SetPosteriorGraph:
    """The set posterior with misfit limits that refuse at most one consistent set in a hundred."""
    task = partial(_misfits, replace(posterior, limits=NO_LIMITS))
    found = _by_size(task, "measuring misfit", progress)
    readings, misfit = (np.concatenate(part) for part in zip(*found.values(), strict=True))
    return replace(posterior, limits=misfit_limits(readings, misfit))


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
    scale = np.ones_like(sets.truth)
    for k, axis in enumerate(posterior.family.axes[: posterior.family.targets]):
        scale[:, k] = sets.context.get(f"{axis.name}_max", scale[:, k])
    prior_std = prior_summary(posterior.family)["std"] * scale
    return SetFigures(
        sets=len(error),
        relative=np.sqrt(np.mean((error / prior_std) ** 2, axis=0)),
        cover90=np.mean((sets.truth >= low) & (sets.truth <= high), axis=0),
        joint90=float(np.mean(mahalanobis <= chi2.ppf(0.9, error.shape[1]))),
        refused=1.0 - float(np.mean([a["set_in_range"][0] for a in outputs])),
    )


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
    """All outputs of the session for one simulated set without an earlier state, by name.

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


#: Rows of the probe, and the sets among which the first suitable one is taken.
PROBE_ROWS, PROBE_CANDIDATES, PROBE_SEED = 8, 16, 5


def metadata_of(posterior: SetPosteriorGraph, sets_only: bool) -> dict[str, Any]:
    """The entry `set` of the metadata; the runtime reads terms to alone."""
    return {
        "terms": len(posterior.response.terms),
        "noise": {name: list(parts) for name, parts in posterior.noise.items()},
        "context": posterior.family.limits(),
        "errors": posterior.typical_errors,
        "model_errors": posterior.family.model_errors(),
        "model_error_scales": posterior.scales.as_list(),
        "alone": sets_only,
        "least_share_in_range": LEAST_SHARE_IN_RANGE,
        "error": dict(zip(RESPONSE_CHANNELS, posterior.response.error.tolist(), strict=True)),
        "interval": list(INTERVAL),
        "misfit": {
            "readings": posterior.limits.readings.tolist(),
            "most": posterior.limits.misfit.tolist(),
        },
        **({"carried": posterior.response.carried} if posterior.response.carried < 1.0 else {}),
        **({"small": True, "monomials": posterior.response.terms} if posterior.small else {}),
        **posterior.family.metadata(),
    }


def probe_of_sets(posterior: SetPosteriorGraph | None) -> list[dict[str, Any]]:
    """A simulated set of torque readings with its estimate; none without a set posterior.

    The runtime repeats the estimate when it loads the file.
    """
    if posterior is None:
        return []
    sets = posterior.family.sets(PROBE_CANDIDATES, PROBE_ROWS, PROBE_SEED)
    session = posterior_session(posterior)
    for index in range(len(sets.truth)):
        rows = {k: v.astype(np.float32).astype(np.float64) for k, v in sets.rows(index).items()}
        outputs = graph_outputs(session, posterior.response, sets, index)
        if outputs["set_in_range"][0] and (rows["sinkage_std"] == ABSENT_STD).all():
            break
    names = ("slip", "torque", "load", "torque_std", "torque_bias")
    return [
        {
            "readings": {name: rows[name].tolist() for name in names},
            "given": sets.context_of(index) | dict.fromkeys(COMMON_ERROR_INPUTS, 0.0),
            "mean": outputs["set_mean"].tolist(),
            "std": outputs["set_std"].tolist(),
            "in_range": True,
        }
    ]


def figures_of(figures: Mapping[int, SetFigures]) -> dict[str, Any]:
    """Accuracy by rows of a set, as the metadata have it."""
    return {
        str(rows): {
            "sets": accuracy.sets,
            "rmse_share_of_prior": accuracy.relative.tolist(),
            "cover90": accuracy.cover90.tolist(),
            "joint90": accuracy.joint90,
            "refused": accuracy.refused,
        }
        for rows, accuracy in figures.items()
    }


def table_of(figures: Mapping[int, SetFigures], names: list[str]) -> list[str]:
    """Accuracy by rows of a set as a Markdown table, for the card."""
    head = " | ".join(f"{what} {n}" for what in ("error", "90 %") for n in names)
    lines = [f"| rows | sets | {head} | joint 90 % | refused |"]
    lines.append("|---:|---:|" + "---:|" * (2 * len(names) + 2))
    for rows, accuracy in figures.items():
        columns = [f"{v:.3f}" for v in accuracy.relative] + [f"{v:.1%}" for v in accuracy.cover90]
        columns += [f"{accuracy.joint90:.1%}", f"{accuracy.refused:.1%}"]
        lines.append(f"| {rows} | {accuracy.sets} | {' | '.join(columns)} |")
    return [*lines, ""]
