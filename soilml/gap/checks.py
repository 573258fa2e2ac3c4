"""Data checks before an analysis: which data can be analysed, and which can identify a cause."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilml.fitting.readings import LEAST_RELATIVE_STD, Readings
from soilml.quantities import column
from soilml.remarks import Remark

#: Degrees of freedom that repeated rows must have for an estimate of the noise: its relative
#: standard error is then 30 %.
MIN_REPEAT_DEGREES_OF_FREEDOM = 6
#: Readings beyond the number of soil parameters that an analysis needs, and that a name needs: with
#: fewer, the noise cannot be told from the declared one.
MIN_RESIDUAL_READINGS, NAMING_RESIDUAL_READINGS = 4, 8


def faults_of(readings: Readings, parameters: int) -> Iterator[Remark]:
    """Why readings cannot be analysed; `parameters` is the number of free soil parameters."""
    for i, name in enumerate(readings.channels):
        own, key = readings.channel == i, column(name)
        values, std = readings.measured[own], readings.std[own]
        if not np.isfinite(std).all():
            text = (
                f"the noise of {key} is not declared and there are no repeated rows to estimate "
                f'it from: give [noise] {key}, as in {key} = "2 %", or a column {key}_std'
            )
            yield Remark("noise-undeclared", text, (key,))
        largest, most = float(np.abs(values).max(initial=0.0)), float(np.nanmax(std, initial=0.0))
        if 0.0 < most <= LEAST_RELATIVE_STD * largest:
            text = (
                f"the noise of {key} is {most:.3g} or less, its largest reading {largest:.3g}: no "
                "sensor resolves so much; declare one such as '2 % + 0.05'"
            )
            yield Remark("noise-too-small", text, (key,))
        if values.size > 3 and np.ptp(values) == 0.0:
            text = f"{key} is the same in every row: check the sensor"
            yield Remark("constant-channel", text, (key,))
    if not readings.channels:
        yield Remark("no-channel", "no torque, drawbar pull or sinkage was measured")
    elif len(readings) < parameters + MIN_RESIDUAL_READINGS:
        yield _few_readings(readings, parameters, MIN_RESIDUAL_READINGS, "")


def naming_obstacles(readings: Readings, parameters: int) -> Iterator[Remark]:
    """Why readings that can be analysed cannot identify a cause."""
    if len(readings) < parameters + NAMING_RESIDUAL_READINGS:
        yield _few_readings(readings, parameters, NAMING_RESIDUAL_READINGS, " to name a cause")
    if len(readings.runs) < 2:
        text = "there is one run only: its variation cannot be told from a gap"
        yield Remark("one-run", text)
    if readings.load_levels.count < 2:
        text = "there is one load only: soil parameters and effects are confounded"
        yield Remark("one-load", text)
    if readings.slip_levels.count < 3:
        text = "there are too few slips: with two, effects that vary with slip look alike"
        yield Remark("few-slips", text)


def _few_readings(readings: Readings, parameters: int, least: int, what: str) -> Remark:
    count = "1 reading" if len(readings) == 1 else f"{len(readings)} readings"
    text = f"there are few readings: {count} for {parameters} soil parameters; at least "
    return Remark("few-readings", f"{text}{parameters + least} are needed{what}")


def estimate_repeat_noise(readings: Readings) -> tuple[dict[str, float], list[Remark]]:
    """Noise of the channels without declared noise, from repeated rows, and notes about it."""
    noise, notes = {}, []
    for i, name in enumerate(readings.channels):
        own = np.flatnonzero((readings.channel == i) & ~np.isfinite(readings.std))
        if not own.size:
            continue
        values, key = readings.measured[own], column(name)
        _, group = np.unique(readings.replicates[own], return_inverse=True)
        count = np.bincount(group)
        freedom = int((count - 1).sum())
        if freedom < MIN_REPEAT_DEGREES_OF_FREEDOM:
            continue
        squares = float(np.sum((values - (np.bincount(group, values) / count)[group]) ** 2))
        std, begin = float(np.sqrt(squares / freedom)), f"noise of {key} is not declared"
        if std <= LEAST_RELATIVE_STD * float(np.abs(values).max()):
            text = f"{begin}, and its repeated rows are equal: none can be estimated from them"
            notes.append(Remark("repeats-equal", text, (key,)))
            continue
        noise[name] = std
        text = f"{begin}: {std:.3g} was estimated from repeated rows"
        notes.append(Remark("noise-estimated", text, (key,), "note"))
    return noise, notes
