"""The gate: which data can be analysed at all, and which readings are set aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.gap.data.observations import Cells, distinct
from soilml.io.table import Table
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Degrees of freedom that repeated rows must give before they speak for the noise.
LEAST_REPEATS = 6
#: Readings beyond the number of soil parameters that an analysis needs.
SPARE = 8


@dataclass(frozen=True)
class Gate:
    """What the gate says: reasons to refuse, reasons to name nothing, and notes."""

    refused: tuple[str, ...] = ()
    unnameable: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def without_repeats(table: Table) -> tuple[Table, int]:
    """The table without rows that repeat another one to the last digit, and how many there were."""
    names = [n for n in table.columns if n != "source"]
    keys = list(zip(*[[str(v) for v in table[n]] for n in names], strict=True))
    first = {key: i for i, key in reversed(list(enumerate(keys)))}
    kept = np.asarray(sorted(first.values()), dtype=np.int64)
    return (table, 0) if kept.size == len(table) else (table.rows(kept), len(table) - kept.size)


def repeated_noise(cells: Cells) -> tuple[dict[str, float], list[str]]:
    """Noise of the channels that declare none, from rows driven alike, and notes about it."""
    found, notes = {}, []
    for i, name in enumerate(cells.channels):
        here = np.flatnonzero((cells.channel == i) & ~np.isfinite(cells.std))
        if here.size == 0:
            continue
        slip, load = cells.slip[here], cells.load[here]
        key = np.stack([np.round(slip / 0.02), np.round(np.log(load) / 0.05)], axis=1)
        _, group = np.unique(key, axis=0, return_inverse=True)
        count = np.bincount(group)
        mean = np.bincount(group, cells.reading[here]) / count
        freedom = int((count - 1).sum())
        if freedom < LEAST_REPEATS:
            continue
        spread = float(np.sum((cells.reading[here] - mean[group]) ** 2))
        found[name] = float(np.sqrt(spread / freedom))
        notes.append(
            f"noise of {column(name)} is not declared: {found[name]:.3g} from rows driven alike"
        )
    return found, notes


def examined(cells: Cells, table: Table, repeats: int, parameters: int) -> Gate:
    """What these data allow, before anything is fitted."""
    refused: list[str] = []
    unnameable: list[str] = []
    notes: list[str] = []
    for i, name in enumerate(cells.channels):
        here = cells.channel == i
        if not np.isfinite(cells.std[here]).all():
            refused.append(
                f"the noise of {column(name)} is not declared and no rows were driven alike: give "
                f"[noise] {column(name)}, or {column(name)}_std"
            )
        readings = cells.reading[here]
        if readings.size > 3 and np.ptp(readings) == 0.0:
            refused.append(f"{column(name)} is the same in every row: is the sensor alive?")
    if repeats:
        text = f"{repeats} rows repeat another one to the last digit and are left out"
        (refused if repeats > 0.2 * (len(table) + repeats) else notes).append(text)
    if not cells.channels:
        refused.append("no torque, drawbar pull or sinkage was measured")
    elif len(cells) < parameters + SPARE:
        count = "1 reading" if len(cells) == 1 else f"{len(cells)} readings"
        refused.append(f"{count} for {parameters} soil parameters: nothing is left to show a gap")
    if len(cells.runs) < 2:
        unnameable.append("one run only: soil that differs from run to run cannot be told apart")
    if cells.channels and distinct(np.log(cells.load)) < 2:
        unnameable.append("one load only: soil parameters and effects trade off")
    if cells.channels and distinct(cells.slip) < 3:
        unnameable.append("fewer than three slips: nothing that runs with slip can be told apart")
    return Gate(tuple(refused), tuple(unnameable), tuple(notes))
