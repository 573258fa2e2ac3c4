"""Errors of a case's model in the readings that a trained file gets: [discrepancy], [remainder]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import recipe_case
from soilml.config.measurement_noise import Discrepancy, range_with_zero
from soilml.config.remainder import Remainder
from soilml.numerics.smooth_process import independent_bound, process_columns, slip_load_points
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import INFERRED, MODEL_ERROR_INPUT
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark


def with_exact_model(estimator: Estimator) -> Estimator:
    """The estimator with a model that has no errors, where it would infer their size."""
    if estimator.sets is None or estimator.sets.common_errors.get(MODEL_ERROR_INPUT) != INFERRED:
        return estimator
    return estimator.on(model_error=0.0)


def readings_with_model_error(
    estimator: Estimator, readings: Mapping[str, Any], case: Case | None, *, together: bool
) -> dict[str, Any]:
    """Inputs (rows,) by name of a trained file, with the errors of a case's model.

    A remainder that the file was trained with is in it already, and not taken from the readings. A
    file that takes no noise of a row gets the readings less the mean of the remainder.

    readings: Inputs by name: slip, load, channels and their `<name>_std`.
    together: Whether the rows are estimated together.
    """
    if case is None:
        return dict(readings)
    takes_noise = estimator.sets is not None and (together or estimator.sets.sets_only)
    noise = estimator.sets.noise if estimator.sets is not None and takes_noise else None
    learned = case.remainder if trained_remainder(estimator) is None else None
    return with_model_error(case.discrepancy, learned, readings, noise, together=together)


def with_model_error(
    discrepancy: Mapping[str, Discrepancy],
    learned: Remainder | None,
    readings: Mapping[str, Any],
    noise: Mapping[str, tuple[float, float]] | None,
    *,
    together: bool,
) -> dict[str, Any]:
    r"""Readings (rows,) by name, less the mean of a remainder, with the errors in their stds.

    .. math:: y_i' = y_i - E[\delta_i], \quad
        \sigma_i'^2 = \sigma_i^2 + \sum_j |\operatorname{cov}[\delta_i, \delta_j]|

    A model file takes the errors of the rows as independent, those of the model are alike in
    neighbouring rows. With the sum of the covariances the independent errors are no smaller in any
    combination of the rows, so that the estimate of rows that are taken `together` is wider than
    with the process itself, never narrower. For rows estimated one by one the sum is the variance.

    discrepancy: By column name, as in `Case`; of channels that `learned` has not.
    learned: The remainder. Soil and effects are fitted anew.
    readings: Inputs of the model file by name, (rows,): slip, load, channels and their
        `<name>_std`.
    noise: Constant part and share of the noise by name, where there is no `<name>_std`; None where
        the file takes none.

    References: Golub and Van Loan, Matrix Computations, section 4.1.1 (diagonal dominance).
    """
    changed = dict(readings)
    for name in CHANNELS:
        own = discrepancy.get(column(name))
        parts = [] if learned is None else learned.of(name)
        if name not in readings or not (parts or own):
            continue
        reading = np.asarray(readings[name], dtype=np.float64)
        known = np.isfinite(reading)
        slip, load = (np.broadcast_to(readings[k], reading.shape)[known] for k in ("slip", "load"))
        if learned is not None and parts:
            changed[name] = reading.copy()
            changed[name][known] -= learned.mean_and_std(name, slip, load)[0]
            columns = learned.process_columns(name, slip, load, fitted_anew=True)
        elif own is not None:
            points = slip_load_points(slip, load, own.slip_length, own.log_load_length)
            columns = process_columns(points, own.amplitude(range_with_zero(reading)))
        if noise is not None:
            constant, share = noise.get(name, (0.0, 0.0))
            std = readings.get(f"{name}_std", np.hypot(constant, share * np.abs(reading)))
            error = np.zeros(reading.shape)
            error[known] = independent_bound(columns) if together else (columns**2).sum(axis=1)
            changed[f"{name}_std"] = np.sqrt(np.asarray(std) ** 2 + error)
    return changed


def model_error_remarks(estimator: Estimator, case: Case, *, pooled: bool) -> list[Remark]:
    """What an estimate does with the errors of a case's model; none for a case without."""
    learned = [] if case.remainder is None else case.remainder.columns
    declared = [key for key in case.discrepancy if key not in learned]
    no_noise = estimator.sets is None or not (pooled or estimator.sets.sets_only)
    enlarged = (
        "as independent errors of the rows, enlarged by the rows near them: intervals are wider "
        "than those of soilml identify"
    )
    remarks = []
    if declared and no_noise:
        text = f"estimate ignores the [discrepancy] of {', '.join(declared)}: the file takes no "
        remarks.append(Remark("ignored-setting", f"{text}noise of a row", tuple(declared)))
    elif declared:
        text = f"[discrepancy] of {', '.join(declared)} is included {enlarged}"
        remarks.append(Remark("discrepancy-included", text, tuple(declared), "note"))
    if not learned:
        return remarks
    trained = trained_remainder(estimator)
    text = f"[remainder] of {', '.join(learned)}"
    if trained == case.remainder:
        text = f"the file was trained with the {text}"
        return [*remarks, Remark("remainder-included", text, tuple(learned), "note")]
    if trained is not None:
        text = f"{text} is ignored: the file was trained with another one"
        return [*remarks, Remark("remainder-ignored", text, tuple(learned))]
    if no_noise:
        text = f"{text}: its mean is taken from the readings, its error is not in the intervals"
        return [*remarks, Remark("remainder-ignored", text, tuple(learned))]
    text = f"{text}: its mean is taken from the readings, its error is included {enlarged}"
    return [*remarks, Remark("remainder-included", text, tuple(learned), "note")]


def trained_remainder(estimator: Estimator) -> Remainder | None:
    """The remainder in the recipe of a file."""
    own = recipe_case(estimator.metadata["recipe"], str(estimator.path))
    return None if own is None else own.remainder
