"""What is known of a soil after its rows, and the rows that are worth measuring next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError, InputError
from soilml.experiment_design import design
from soilml.experiment_design.parameter_samples import (
    ParameterSamples,
    samples_of_prior,
    samples_of_rows,
)
from soilml.fitting.coordinates import select_free
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.fit import Fit
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import column
from soilml.remarks import Remark

COUNT = 3  # Default number of rows in the sequence
#: Samples and simulated readings of an advice that accompanies a result: takes half a second.
QUICK_SAMPLES, QUICK_OUTCOMES = 768, 128
SEQUENCE_LENGTH = 2  # Rows in the planned sequence of such an advice


@dataclass(frozen=True)
class SoilKnowledge:
    """Samples of the soil's parameters by the prior, or after rows.

    case: With the noise of the rows' columns where it declares none.
    measured: Operating points of the rows; None without.
    loads: Loads of the rows, N (rows,); empty without.
    notes: What to know of the rows.
    """

    case: Case
    samples: ParameterSamples
    measured: Operating | None
    loads: Floats
    notes: tuple[Remark, ...]


def known_soil(
    case: Case, rows: Rows | None, free: Sequence[str] | None = None, exact_model: bool = False
) -> SoilKnowledge:
    """What is known after rows; by the prior without.

    Raises `InputError`, `TableError` and `FitError` as `identify` does.
    """
    selected = select_free(case, free)
    if rows is None:
        return SoilKnowledge(case, samples_of_prior(selected, case=case), None, np.empty(0), ())
    readings = usable_readings(case, as_table(rows))
    case, taken = _with_noise_of_rows(case, readings)
    samples = samples_of_rows(case, readings, selected, exact_model=exact_model)
    notes = (*taken, *readings.notes)
    return SoilKnowledge(case, samples, readings.at, readings.row_load, notes)


def _with_noise_of_rows(case: Case, readings: Readings) -> tuple[Case, list[Remark]]:
    """The case with the noise of the rows' columns where it declares none: their median."""
    noise, notes = dict(case.noise), []
    for i, name in enumerate(readings.channels):
        key, own = column(name), readings.channel == i
        if key not in noise and key not in readings.undeclared:
            std = float(np.median(readings.std[own]))
            noise[key] = Noise(constant=std)
            text = f"the noise of further {key} is taken from {key}_std: {std:.3g}"
            notes.append(Remark("noise-of-rows", text, (key,), "note"))
    return replace(case, noise=noise), notes


def advise(
    case: GivenCase,
    rows: Rows | None = None,
    *,
    free: Sequence[str] | None = None,
    slips: Sequence[float] | None = None,
    loads: Sequence[float] | None = None,
    count: int = COUNT,
    exact_model: bool = False,
) -> design.Advice:
    """The rows that are worth measuring next, by the variance expected to remain after them.

    Parameters
    ----------
    case
        Model, soil, priors and noise, or the path of a model file.
    rows
        Rows measured so far, as for `identify`; without them, only the prior is known.
    free
        Paths of the unknown parameters; by default those with a prior.
    slips, loads
        Slips and loads (N) that can be driven; by default usual slips, and the loads of the rows.
    count
        Length of the planned sequence.
    exact_model
        Whether model and sensors are exactly as in the file.

    Returns
    -------
    Advice
        `to_frame()` has a row for each candidate, the best first.

    Raises
    ------
    InputError, TableError, FitError
        As `identify`; also without loads where there are no rows, and without declared noise.
    """
    known = known_soil(
        as_case(case, with_bias=False, with_explanations=False), rows, free, exact_model
    )
    grid = design.candidate_grid(slips, loads, known.loads)
    covariates = {} if known.measured is None else mean_covariates(known.measured)
    return design.advise(
        known.case,
        known.samples,
        grid,
        measured=known.measured,
        count=count,
        covariates=covariates,
    )


def advice_after_fit(
    case: Case, table: Table, free: Sequence[str] | None, fit: Fit
) -> design.Advice | None:
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
        return design.advise(
            case,
            samples,
            design.candidate_grid(None, None, readings.row_load),
            measured=readings.at,
            count=SEQUENCE_LENGTH,
            covariates=mean_covariates(readings.at),
            current_fraction=np.asarray([fit.remaining_fraction[f.path] for f in samples.free]),
            outcome_count=QUICK_OUTCOMES,
        )
    except (FitError, InputError):
        return None


def mean_covariates(at: Operating) -> dict[str, float]:
    """Means of the covariates of measured rows, which are assumed for the next row."""
    values = {field: getattr(at, field) for field in COVARIATES}
    return {field: float(np.mean(value)) for field, value in values.items() if value is not None}
