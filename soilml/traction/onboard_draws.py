"""Draws of soil parameters from the estimate of a trained model file."""

from __future__ import annotations

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import (
    effect_differences,
    gear_differences,
    recipe_case,
    value_differences,
)
from soilml.errors import FitError, InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import ignored_discrepancy
from soilml.fitting.soil_tests import ignored_soil_tests
from soilml.identification.trained_estimator import std_with_discrepancy
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.traction.moment_draws import estimated_draws
from soilml.traction.soil_draws import SoilDraws


def onboard_draws(
    estimator: Estimator, case: Case, table: Table
) -> tuple[list[Coordinate], SoilDraws, list[Remark]]:
    """Parameters that the file estimates with their priors, draws of its estimate, and warnings.

    Raises `InputError` where the file is for another gear or estimates a parameter that the case
    lacks, and `FitError` where no row has all its readings.
    """
    warnings = _check_case(estimator, case)
    known, prior = case.parameters(), estimator.prior
    for name in estimator.names:
        if name not in known:
            raise InputError(f"{estimator.path} estimates {name}; the model has {', '.join(known)}")
    free = [
        Coordinate(name, unit, Prior(float(low), float(high)), float(known[name][1]), assumed=False)
        for name, unit, low, high in zip(
            estimator.names, estimator.units, prior.lower, prior.upper, strict=True
        )
    ]
    inputs = {name: table[column(name)] for name in estimator.inputs}
    complete = np.all([np.isfinite(values) for values in inputs.values()], axis=0)
    if not complete.any():
        names = ", ".join(column(name) for name in estimator.inputs)
        raise FitError(f"{table.source}: no row has all of {names}, which {estimator.path} reads")
    readings = {name: values[complete] for name, values in inputs.items()}
    if estimator.sets is None:
        warnings += ignored_discrepancy(case, estimator.path)
    elif case.discrepancy:
        noise = estimator.sets.noise
        readings |= std_with_discrepancy(case.discrepancy, readings, noise, together=True)
    warnings += ignored_soil_tests(case)
    estimate = estimator.run(**readings)
    if not estimate.in_range:
        text = (
            f"the rows are outside the training domain of {estimator.path}, which returns the "
            "prior, or no soil explains them, which widens its estimate"
        )
        warnings.append(Remark("out-of-range", text))
    return free, estimated_draws(free, estimate.mean, estimate.covariance), warnings


def _check_case(estimator: Estimator, case: Case) -> list[Remark]:
    """Warnings of fixed values and effects that differ; raises `InputError` for another gear."""
    trained = recipe_case(estimator.metadata["recipe"], estimator.path)
    if trained is None:
        return []
    for difference in gear_differences(case, trained):
        raise InputError(
            f"{estimator.path} was trained with {difference}; train a model for this gear"
        )
    found = [(text, "soil") for text in value_differences(case, trained)]
    found += [(text, "model") for text in effect_differences(case, trained)]
    head = f"{estimator.path} was trained with"
    return [
        Remark(f"another-{what}", f"{head} {text}: its estimate is of another {what}")
        for text, what in found
    ]
