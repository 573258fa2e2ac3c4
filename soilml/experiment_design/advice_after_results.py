"""The advised next measurement after a fit, and after the estimate of a trained model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case, take_case
from soilml.errors import FitError, InputError, SoilmlError
from soilml.experiment_design.design import Advice, CandidateGrid, advise, candidate_grid
from soilml.experiment_design.expected_answers import advise_by_answers
from soilml.experiment_design.parameter_samples import ParameterSamples, samples_of_rows
from soilml.experiment_design.presentation import next_row_remarks
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.fit import Fit
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import CHANNELS
from soilml.remarks import Remark

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator


#: Samples and simulated readings of an advice that accompanies a result: takes half a second.
QUICK_SAMPLES, QUICK_OUTCOMES = 768, 128
SEQUENCE_LENGTH = 2  # Rows in the planned sequence of such an advice
#: Tables and keys of a recipe that a case contains, or that concern the sampling of rows only.
CASE_KEYS = {"gear", "soil", "effect", "noise", "discrepancy", "operating", "rows", "seed", "runs"}
GRID_SIZE = 4  # Candidate slips, and loads, in the ranges of a recipe


def advice_after_fit(
    case: Case, table: Table, free: Sequence[str] | None, fit: Fit
) -> Advice | None:
    """Advice after the posterior method gave `fit`; None where none is possible.

    That is the case where [noise] declares no channel, where no candidate is known to be feasible,
    and where several gears were driven.
    """
    if case.gears:
        return None
    try:
        readings = usable_readings(case, table)
        selected = select_free(case, free)
        samples = samples_of_rows(case, readings, selected, QUICK_SAMPLES, found=fit.samples)
        current = np.asarray([fit.remaining_fraction[f.path] for f in samples.free])
        return _quick(
            case,
            samples,
            candidate_grid(None, None, readings.row_load),
            readings.at,
            current_fraction=current,
        )
    except (FitError, InputError):
        return None


def advice_of_file(
    estimator: Estimator,
    mean: Floats,
    covariance: Floats,
    readings: Mapping[str, Floats],
    box: Mapping[str, tuple[float, float]] | None = None,
) -> Advice | None:
    """Advice after an estimate, (q,) and (q, q), of readings (rows,); None where none is possible.

    What a next row leaves is what the file itself answers with that row, within the narrower prior
    `box` if there is one: its errors of sensors and of the model are in the expectation as they are
    in the answer. Model, prior and noise of simulated readings are those of the recipe in the file;
    slips, loads and sensors are those of its training. None where the recipe has what a case lacks:
    sensor bias, vibration, speed, or slip as a target.
    """
    trained = trained_case(estimator)
    if trained is None:
        return None
    case, ranges = trained
    try:
        return advise_by_answers(estimator, case, ranges, mean, covariance, readings, box or {})
    except (SoilmlError, ValueError):  # LinAlgError is one: no covariance, or none of this case
        return None


def advice_after_estimate(
    estimator: Estimator,
    mean: Floats,
    covariance: Floats,
    readings: Mapping[str, Floats],
    box: Mapping[str, tuple[float, float]] | None = None,
) -> list[Remark]:
    """Remarks on the next measurement; arguments as for `advice_of_file`."""
    advice = advice_of_file(estimator, mean, covariance, readings, box)
    if advice is None:
        return []
    return next_row_remarks(advice, "this row" if np.size(readings["slip"]) == 1 else "these rows")


def mean_covariates(at: Operating) -> dict[str, float]:
    """Means of the covariates of measured rows, which are assumed for the next row."""
    values = {field: getattr(at, field) for field in COVARIATES}
    return {field: float(np.mean(value)) for field, value in values.items() if value is not None}


def _quick(
    case: Case,
    samples: ParameterSamples,
    ranges: CandidateGrid,
    driven: Operating,
    *,
    current_fraction: Floats,
) -> Advice:
    return advise(
        case,
        samples,
        ranges,
        measured=driven,
        count=SEQUENCE_LENGTH,
        covariates=mean_covariates(driven),
        current_fraction=current_fraction,
        outcome_count=QUICK_OUTCOMES,
    )


def trained_case(estimator: Estimator) -> tuple[Case, CandidateGrid] | None:
    """Case and candidate grid of a file for one wheel; None where no case can represent it."""
    read = {*estimator.inputs}
    if estimator.per_row or not {"slip", "load"} < read <= {"slip", "load", *CHANNELS}:
        return None
    try:
        recipe = json.loads(estimator.metadata["recipe"])
        if recipe.keys() - CASE_KEYS or recipe["operating"].keys() - {"slip", "load_N"}:
            return None
        case = take_case(Settings(recipe, estimator.path))
        ends = [recipe["operating"][key] for key in ("slip", "load_N")]
        pairs = [entry["range"] if isinstance(entry, dict) else entry for entry in ends]
        slips, loads = ([float(x) for x in np.linspace(a, b, GRID_SIZE)] for a, b in pairs)
        return case, CandidateGrid(tuple(slips), tuple(loads))
    except (SoilmlError, AttributeError, KeyError, TypeError, ValueError):
        return None
