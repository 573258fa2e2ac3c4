"""Data checks before an analysis: which data can be analysed, and which can identify a cause.

A new check is a function from `CheckedData` to findings, listed in `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from soilml.fitting.readings import LEAST_RELATIVE_STD, Readings
from soilml.io.table import Table
from soilml.quantities import column
from soilml.remarks import Remark

#: Degrees of freedom that repeated rows must have for an estimate of the noise: its relative
#: standard error is then 30 %.
MIN_REPEAT_DEGREES_OF_FREEDOM = 6
#: Readings beyond the number of soil parameters that an analysis needs, and that a name needs: with
#: fewer, the noise cannot be told from the declared one.
MIN_RESIDUAL_READINGS, NAMING_RESIDUAL_READINGS = 4, 8
ONE_LOAD = "one-load"  # Code of the obstacle that one load cannot test the soil parameters


@dataclass(frozen=True)
class DataCheckResult:
    """Errors that prevent an analysis, obstacles to naming a cause, and notes."""

    errors: tuple[Remark, ...] = ()
    naming_obstacles: tuple[Remark, ...] = ()
    notes: tuple[Remark, ...] = ()


@dataclass(frozen=True)
class CheckedData:
    """What the checks look at; `parameters` is the number of free soil parameters."""

    readings: Readings
    rows: int
    parameters: int


class Consequence(Enum):
    """Consequence of a finding."""

    ERROR = "no analysis"
    NAMING_OBSTACLE = "no cause can be named"
    NOTE = "for information"


Finding = tuple[Consequence, Remark]


def check_readings(readings: Readings, table: Table, parameters: int) -> DataCheckResult:
    """Run all data checks; `parameters` is the number of free soil parameters."""
    data = CheckedData(readings, len(table), parameters)
    findings = [finding for check in CHECKS for finding in check(data)]
    errors, obstacles, notes = (
        tuple(remark for consequence, remark in findings if consequence is wanted)
        for wanted in Consequence
    )
    return DataCheckResult(errors, obstacles, notes)


def _check_channels(data: CheckedData) -> Iterator[Finding]:
    readings = data.readings
    for i, name in enumerate(readings.channels):
        in_channel, key = readings.channel == i, column(name)
        if not np.isfinite(readings.std[in_channel]).all():
            text = (
                f"the noise of {key} is not declared and there are no repeated rows to estimate "
                f'it from: give [noise] {key}, as in {key} = "2 %", or a column {key}_std'
            )
            yield Consequence.ERROR, Remark("noise-undeclared", text, (key,))
        values = readings.measured[in_channel]
        largest = float(np.abs(values).max(initial=0.0))
        std = float(np.nanmax(readings.std[in_channel], initial=0.0))
        if 0.0 < std <= LEAST_RELATIVE_STD * largest:
            text = (
                f"the noise of {key} is {std:.3g} or less, its largest reading {largest:.3g}: no "
                "sensor resolves so much; declare one such as '2 % + 0.05'"
            )
            yield Consequence.ERROR, Remark("noise-too-small", text, (key,))
        if values.size > 3 and np.ptp(values) == 0.0:
            text = f"{key} is the same in every row: check the sensor"
            yield Consequence.ERROR, Remark("constant-channel", text, (key,))


def _check_count(data: CheckedData) -> Iterator[Finding]:
    count = len(data.readings)
    if not data.readings.channels:
        text = "no torque, drawbar pull or sinkage was measured"
        yield Consequence.ERROR, Remark("no-channel", text)
        return
    for least, consequence, what in (
        (MIN_RESIDUAL_READINGS, Consequence.ERROR, "are needed"),
        (NAMING_RESIDUAL_READINGS, Consequence.NAMING_OBSTACLE, "are needed to name a cause"),
    ):
        if count < data.parameters + least:
            text = (
                f"{'1 reading' if count == 1 else f'{count} readings'} for {data.parameters} soil "
                f"parameters: at least {data.parameters + least} readings {what}"
            )
            yield consequence, Remark("few-readings", text)
            return


def _check_variety(data: CheckedData) -> Iterator[Finding]:
    readings = data.readings
    if len(readings.runs) < 2:
        text = "one run only: run-to-run variation of the soil cannot be separated from a gap"
        yield Consequence.NAMING_OBSTACLE, Remark("one-run", text)
    if not readings.channels:
        return
    if readings.load_levels.count < 2:
        text = "one load only: soil parameters and effects are confounded"
        yield Consequence.NAMING_OBSTACLE, Remark(ONE_LOAD, text)
    if readings.slip_levels.count < 3:
        text = "fewer than three slips: effects that vary with slip cannot be distinguished"
        yield Consequence.NAMING_OBSTACLE, Remark("few-slips", text)


#: All data checks, in the order in which their findings are reported.
CHECKS: tuple[Callable[[CheckedData], Iterator[Finding]], ...] = (
    _check_channels,
    _check_count,
    _check_variety,
)


def estimate_repeat_noise(readings: Readings) -> tuple[dict[str, float], list[Remark]]:
    """Noise of the channels without declared noise, from repeated rows, and notes about it."""
    noise, notes = {}, []
    for i, name in enumerate(readings.channels):
        undeclared = np.flatnonzero((readings.channel == i) & ~np.isfinite(readings.std))
        if undeclared.size == 0:
            continue
        _, group = np.unique(readings.replicates[undeclared], return_inverse=True)
        count = np.bincount(group)
        mean = np.bincount(group, readings.measured[undeclared]) / count
        degrees_of_freedom = int((count - 1).sum())
        if degrees_of_freedom < MIN_REPEAT_DEGREES_OF_FREEDOM:
            continue
        squares = float(np.sum((readings.measured[undeclared] - mean[group]) ** 2))
        std = float(np.sqrt(squares / degrees_of_freedom))
        if std <= LEAST_RELATIVE_STD * float(np.abs(readings.measured[undeclared]).max()):
            text = (
                f"noise of {column(name)} is not declared, and its repeated rows are equal: none "
                "can be estimated from them"
            )
            notes.append(Remark("repeats-equal", text, (column(name),)))
            continue
        noise[name] = std
        text = (
            f"noise of {column(name)} is not declared: {noise[name]:.3g} was estimated from "
            "repeated rows"
        )
        notes.append(Remark("noise-estimated", text, (column(name),), "note"))
    return noise, notes
