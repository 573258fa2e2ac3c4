"""The row that is worth measuring next, after those of a table or by the prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.measurement_noise import Noise
from soilml.experiment_design.design import Advice, candidate_grid, rate_rows
from soilml.experiment_design.parameter_samples import samples_of_prior, samples_of_rows
from soilml.fitting.coordinates import select_free
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.io.read_table import Rows, as_table
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column
from soilml.remarks import Remark


def advise(
    case: GivenCase,
    rows: Rows | None = None,
    *,
    free: Sequence[str] | None = None,
    slips: Sequence[float] | None = None,
    loads: Sequence[float] | None = None,
    exact_model: bool = False,
) -> Advice:
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
    case = as_case(case, with_bias=False, with_explanations=False)
    selected = select_free(case, free)
    if rows is None:
        samples = samples_of_prior(selected, case=case)
        found = rate_rows(case, samples, candidate_grid(slips, loads))
        notes, measured = list[Remark](), None
    else:
        readings = usable_readings(case, as_table(rows))
        case, notes = _with_noise_of_rows(case, readings)
        fitted = readings.thinned()
        notes += fitted.notes
        measured = readings.at
        known = {name: getattr(measured, name) for name in COVARIATES}
        covariates = {n: float(np.mean(v)) for n, v in known.items() if v is not None}
        found = rate_rows(
            case,
            samples_of_rows(case, fitted, selected, exact_model=exact_model),
            candidate_grid(slips, loads, readings.row_load),
            covariates=covariates,
        )
    if case.states_model_error:
        which = "[discrepancy]" if case.remainder is None else "error of the [remainder]"
        text = f"the {which} of a next row counts as independent of that of other rows: "
        notes.append(Remark("independent-discrepancy", f"{text}repetitions are overrated"))
    if found.excluded_points:
        text = (
            f"{found.excluded_points} operating points are excluded: a twentieth or more of the "
            "posterior samples does not carry the wheel"
        )
        notes.append(Remark("not-carried", text))
    return replace(found, measured=measured, remarks=tuple(notes))


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
