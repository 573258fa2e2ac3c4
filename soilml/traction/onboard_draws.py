"""Soils drawn from what a trained model file says of rows, instead of from their posterior."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from soilml.config.case import Case, take_case
from soilml.errors import FitError, InputError
from soilml.identification.free_parameters import FreeParameter
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.quantities import column
from soilml.traction.moment_draws import estimated_draws
from soilml.traction.soil_draws import SoilDraws

#: Relative difference of a size, and of another value, that still counts as the same.
OF_SIZES, OF_OTHERS = 0.005, 0.001


def onboard_draws(
    estimator: Estimator, case: Case, table: Table
) -> tuple[list[FreeParameter], SoilDraws, list[str]]:
    """What the file estimates and its range, draws of its estimate of all rows, and warnings.

    Raises `InputError` where the file is of another gear, or estimates what the case lacks, and
    `FitError` where no row has all its readings.
    """
    warnings = _same_case(estimator, case)
    known, prior = case.parameters(), estimator.prior
    for name in estimator.names:
        if name not in known:
            raise InputError(f"{estimator.path} estimates {name}; needed are {', '.join(known)}")
    free = [
        FreeParameter(
            name, unit, Prior(float(low), float(high)), float(known[name][1]), assumed=False
        )
        for name, unit, low, high in zip(
            estimator.names, estimator.units, prior.lower, prior.upper, strict=True
        )
    ]
    read = {name: table[column(name)] for name in estimator.inputs}
    whole = np.all([np.isfinite(values) for values in read.values()], axis=0)
    if not whole.any():
        names = ", ".join(column(name) for name in estimator.inputs)
        raise FitError(f"{table.source}: no row has all of {names}, which {estimator.path} reads")
    estimate = estimator.run(**{name: values[whole] for name, values in read.items()})
    if not estimate.in_range:
        warnings.append(
            f"the rows are out of the range of {estimator.path}: its answer is the prior"
        )
    return free, estimated_draws(free, estimate.mean, estimate.covariance), warnings


def _same_case(estimator: Estimator, case: Case) -> list[str]:
    """Refuse a file of another gear; say in which fixed values it was trained otherwise."""
    recipe = json.loads(estimator.metadata["recipe"], parse_int=float)
    if not recipe:
        return []
    trained = take_case(Settings(recipe, f"recipe of {estimator.path}", Path()))
    if type(trained.model.gear) is not type(case.model.gear):
        raise InputError(
            f"{estimator.path} was trained for a gear of type {trained.model.gear.name}, the model "
            f"file has {case.model.gear.name}; train one for this gear"
        )
    said, theirs = [], trained.parameters()
    for path, (_, own) in case.parameters().items():
        fixed = path in theirs and path not in trained.prior
        if not fixed or _near(own, theirs[path][1], OF_SIZES if "gear." in path else OF_OTHERS):
            continue
        words = f"{estimator.path} was trained with {path} {theirs[path][1]:g}, the model file has"
        if path.startswith("gear."):
            raise InputError(f"{words} {own:g}; train one for this gear")
        said.append(f"{words} {own:g}: its estimate is of another soil")
    names = [{e.name for e in c.model.effects} for c in (trained, case)]
    if names[0] != names[1]:
        said.append(f"{estimator.path} was trained with other effects than the model file has")
    return said


def _near(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))
