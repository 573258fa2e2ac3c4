"""What `identify` and `estimate` say of the row to drive next."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case, take_case
from soilml.errors import FitError, InputError, SoilmlError
from soilml.experiment_design import (
    Advice,
    CandidateGrid,
    ParameterSamples,
    advise,
    candidate_grid,
    samples_of_moments,
    samples_of_rows,
)
from soilml.experiment_design.messages import next_row_messages
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import select_free
from soilml.identification.observations import read_observations
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import CHANNELS, column

Floats = NDArray[np.float64]

#: Samples and simulated readings of an advice that comes along with an answer: half a second.
QUICK_SAMPLES, QUICK_OUTCOMES = 768, 128
#: Rows up to which an estimate's exact posterior takes no more than half a second too.
FEW = 4
#: Rows that the sequence of such an advice plans.
AHEAD = 2
#: Tables of a recipe that a case holds, or that say only how rows are drawn.
HELD = {"gear", "soil", "effect", "noise", "operating", "rows", "seed", "runs"}
#: Slips and loads of a recipe's ranges that are tried.
ALONG = 4


def advice_after_fit(
    case: Case, table: Table, free: Sequence[str] | None, fit: Fit
) -> Advice | None:
    """Advice after rows that the posterior method answered with `fit`; None where there is none.

    That is where [noise] names no channel, or no row that could be driven is known to be possible.
    """
    try:
        data = read_observations(case, table)
        belief = samples_of_rows(case, data, select_free(case, free), QUICK_SAMPLES)
        current = np.asarray([fit.remaining_fraction[f.path] for f in belief.free])
        return _quick(
            case, belief, candidate_grid(None, None, data.load), data.at, current_fraction=current
        )
    except (FitError, InputError):
        return None


def advice_after_estimate(
    estimator: Estimator,
    mean: Floats,
    covariance: Floats,
    readings: Mapping[str, Floats],
) -> list[str]:
    """Lines on what to drive after one estimate, (q,) and (q, q), of readings (rows,); or none.

    The width that is left now is the file's; what a next row does to it is judged by the exact
    posterior of up to `FEW` rows, and by the file's mean and covariance where there are more.
    Model, prior and noise are those of the recipe in the file; slips, loads and sensors those that
    it was trained for. Nothing is said where the recipe holds what a case does not: drift of
    sensors, vibration, speed, a slip to be estimated.
    """
    found = _trained_for(estimator)
    if found is None:
        return []
    case, ranges = found
    slip, load = (np.atleast_1d(readings[key]) for key in ("slip", "load"))
    current = np.sqrt(np.diag(covariance)) / estimator.prior.std
    try:
        free = select_free(case, None)
        if slip.size <= FEW:
            rows = Table({column(n): np.atleast_1d(readings[n]) for n in estimator.inputs})
            belief = samples_of_rows(case, read_observations(case, rows), free, QUICK_SAMPLES)
        else:
            belief = samples_of_moments(free, estimator.names, mean, covariance, QUICK_SAMPLES)
        advice = _quick(
            case,
            belief,
            ranges,
            Operating(slip=slip, load=load),
            channels=estimator.inputs,
            parameters=estimator.names,
            current_fraction=current,
        )
    except (SoilmlError, ValueError):  # LinAlgError is one: no covariance, or none of this case
        return []
    return next_row_messages(advice, "this row" if slip.size == 1 else "these rows")


def _shares(estimate: Estimate) -> NDArray[np.float64]:
    """Width over the prior's of all parameters together, (rows,); NaN out of range."""
    shares = np.sqrt(np.mean((estimate.std / estimate.prior_std) ** 2, axis=1))
    return np.where(estimate.in_range, shares, np.nan)


def median_row(estimate: Estimate) -> int:
    """The row in range that stands in the middle by its width."""
    shares = _shares(estimate)
    return int(np.argsort(shares)[(int(estimate.in_range.sum()) - 1) // 2])


def widest_row(estimate: Estimate) -> int:
    """The row in range that is widest."""
    return int(np.nanargmax(_shares(estimate)))


def mean_covariates(at: Operating) -> dict[str, float]:
    """Further fields of how rows were driven, at their means: the next row is driven so too."""
    given = {field: getattr(at, field) for field in COVARIATES}
    return {field: float(np.mean(value)) for field, value in given.items() if value is not None}


def _quick(
    case: Case,
    belief: ParameterSamples,
    ranges: CandidateGrid,
    driven: Operating,
    *,
    channels: tuple[str, ...] | None = None,
    parameters: tuple[str, ...] | None = None,
    current_fraction: Floats | None = None,
) -> Advice:
    return advise(
        case,
        belief,
        ranges,
        measured=driven,
        count=AHEAD,
        covariates=mean_covariates(driven),
        channels=channels,
        parameters=parameters,
        current_fraction=current_fraction,
        outcome_count=QUICK_OUTCOMES,
    )


def _trained_for(estimator: Estimator) -> tuple[Case, CandidateGrid] | None:
    """The case of a model file and the ranges of slip and load; None where no case can hold it."""
    read = {*estimator.inputs}
    if estimator.per_row or not {"slip", "load"} < read <= {"slip", "load", *CHANNELS}:
        return None
    try:
        recipe = json.loads(estimator.metadata["recipe"])
        if recipe.keys() - HELD or recipe["operating"].keys() - {"slip", "load_N"}:
            return None
        case = take_case(Settings(recipe, estimator.path, Path()))
        ends = [recipe["operating"][key] for key in ("slip", "load_N")]
        pairs = [entry["range"] if isinstance(entry, dict) else entry for entry in ends]
        slips, loads = ([float(x) for x in np.linspace(a, b, ALONG)] for a, b in pairs)
        return case, CandidateGrid(tuple(slips), tuple(loads))
    except (SoilmlError, AttributeError, KeyError, TypeError, ValueError):
        return None
