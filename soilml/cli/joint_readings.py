"""Readings that `estimate` passes to a model file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import OPERATING_NOISE, OPERATING_STD_INPUTS, OPTIONAL_READINGS
from soilml.onboard.set_posterior import SetPosterior
from soilml.quantities import CHANNELS, column

if TYPE_CHECKING:
    from soilml.config.case import Case


def row_readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    """Inputs for the estimates of single rows, (rows,) by name."""
    return {name: table[column(name)] for name in estimator.inputs}


def joint_readings(
    estimator: Estimator, table: Table, case: Case | None = None, *, together: bool = True
) -> dict[str, Any]:
    """Inputs for the pooled estimate of all rows of one soil, (rows,) by name.

    In addition to the required readings: sinkage and drawbar pull where the table has them and
    their noise is known, and columns of standard deviations, those of slip and load included, which
    replace the noise of the file.
    The discrepancy of a case is included in them, for rows of which all are estimated `together`.
    """
    readings = row_readings(estimator, table)
    if estimator.sets is None:
        return readings
    for name in CHANNELS:
        key, spread = column(name), f"{column(name)}_std"
        known = name in estimator.sets.noise or spread in table
        if name in OPTIONAL_READINGS and key in table and known:
            readings[name] = table[key]
        if name in readings and spread in table:
            readings[f"{name}_std"] = _fill_blank_std(
                table[spread], estimator, name, readings[name]
            )
    for name, input_name in zip(OPERATING_NOISE, OPERATING_STD_INPUTS, strict=True):
        if (spread := f"{column(name)}_std") in table:
            readings[input_name] = _fill_blank_std(table[spread], estimator, name, readings[name])
    if case is not None and case.discrepancy:
        from soilml.identification.trained_estimator import std_with_discrepancy

        noise = estimator.sets.noise
        readings |= std_with_discrepancy(case.discrepancy, readings, noise, together=together)
    return readings


def _fill_blank_std(spread: Any, estimator: Estimator, name: str, reading: Any) -> Any:
    """Standard deviations of the table, and those of the model file where one is blank."""
    constant, share = estimator.sets.noise.get(name, (0.0, 0.0)) if estimator.sets else (0.0, 0.0)
    own = np.hypot(constant, share * np.abs(reading))
    return np.where(np.isfinite(spread) & (spread > 0.0), spread, own)


def unused_std_note(estimator: Estimator, table: Table) -> list[str]:
    """A note on columns of standard deviations that estimates of single rows do not use."""
    if estimator.sets is not None and estimator.sets.sets_only:
        return []
    spreads = [f"{column(name)}_std" for name in (*CHANNELS, *OPERATING_NOISE)]
    given = [key for key in spreads if key in table]
    if not given:
        return []
    hint = "give --by" if estimator.sets is not None else "train a file with [set_posterior]"
    return [f"estimates of single rows do not use {', '.join(given)}; {hint} to have them used"]


def channel_note(estimator: Estimator, readings: dict[str, Any]) -> list[str]:
    """A note on the channels used, for a file that can use more than it requires."""
    if estimator.sets is None:
        return []
    used = [
        f"{name.replace('_', ' ')} ({int(np.isfinite(readings[name]).sum())} rows)"
        for name in CHANNELS
        if name in readings and np.isfinite(readings[name]).any()
    ]
    return [f"uses slip, load and {', '.join(used)}", *_common_error_note(estimator.sets)]


def _common_error_note(sets: SetPosterior) -> list[str]:
    """A note on the errors that all rows are assumed to share."""
    texts = {
        "slip_bias": "slip {:g}",
        "load_gain": "load {:.3g} %",
        "torque_gain": "torque {:.3g} %",
        "sinkage_bias": "sinkage {:g} mm",
        "drawbar_pull_bias": "drawbar pull {:g} N",
    }
    factors = {"slip_bias": 1.0, "sinkage_bias": 1e3, "drawbar_pull_bias": 1.0}  # gains in %
    said = [
        texts[name].format(factors.get(name, 100.0) * std)
        for name, std in sets.common_errors.items()
        if std > 0.0 and name in texts
    ]
    if not said:
        return []
    return [f"assumes that all rows share errors with standard deviations of {', '.join(said)}"]
