"""The readings of a table that an identification uses, and remarks on the others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.errors import FitError, InputError, TableError
from soilml.fitting.faulty_readings import sound_rows
from soilml.fitting.operating_points import operating_points, with_rover_columns
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.row_order import with_order_columns
from soilml.io.table import Table
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.operating_point import FROM_ORDER
from soilml.quantities import CHANNELS, QUANTITIES, column
from soilml.remarks import Remark


def usable_readings(case: Case, table: Table, *, drifts: bool = True) -> Readings:
    """The readings that an identification of a case uses of a table.

    drifts: Read what follows from the order of the rows, where it is known, though no effect of the
        case uses it: for drifts among the explanations.

    A channel whose noise is not declared is excluded if that of another one is; if none is, all
    are used and their noise is to be estimated. Rows whose status is not ok are excluded.

    Raises `InputError` where no row remains, `TableError` where the table names another wheel than
    the case's, `FitError` where no reading remains or all standard deviations of one are zero.
    """
    table, remarks = prepared_rows(case, table, FROM_ORDER if drifts else None)
    if isinstance(case.model.gear, EmulatedGear):
        check_design(case.model.gear, table)
    found = stack_readings(case, table, refuse_zeros=True)
    if not found.channels:
        raise FitError(f"{table.source}: no reading of {', '.join(map(column, CHANNELS))}")
    notes = (*remarks, *_remarks_on(case, table), *found.notes)
    return replace(found, notes=notes).with_known_noise()


def prepared_rows(
    case: Case, table: Table, fields: Collection[str] | None
) -> tuple[Table, list[Remark]]:
    """The rows that analyses of a case use, with what follows from their order, and remarks.

    fields: As `with_order_columns` takes them.

    Raises `InputError` where no row remains, `TableError` where the table names another wheel than
    the case's, or two columns are the same.
    """
    table, faults = sound_rows(case, table)
    table = with_rover_columns(case, with_order_columns(case, table, fields))
    check_wheel_size(case, table)
    table, excluded = answered_rows(table)
    return table, [*faults, *excluded]


def check_design(gear: EmulatedGear, table: Table) -> None:
    """Raise `TableError` for a row beyond the runs of a simulator, or a channel that these lack."""
    for name, low, high in zip(gear.inputs, gear.lower, gear.upper, strict=True):
        if name not in ("slip", "load"):
            continue
        values = table[column(name)]
        outside = gear.beyond(name, values)
        if outside.any():
            row = int(np.argmax(outside))
            count = int(outside.sum())
            raise TableError(
                f"{table.place(row)}, column {column(name)}: {values[row]:g} is outside the runs "
                f"of the simulator, {low:g} to {high:g} ({count} such rows): simulate there, or "
                "leave the rows out"
            )
    for name in CHANNELS:
        key = column(name)
        if name not in gear.channels and key in table and np.isfinite(table[key]).any():
            raise TableError(
                f"{table.source}: {key} was measured, and the runs of the simulator lack it: add "
                "it to them, or remove the column"
            )


def answered_rows(table: Table) -> tuple[Table, list[Remark]]:
    """The rows whose status is ok, and a remark on the others; `InputError` where there is none."""
    if not table.answered.any():
        raise InputError(f"{table.source}: no row has the status ok")
    excluded = int(np.count_nonzero(~table.answered))
    if not excluded:
        return table, []
    rows = "1 row is" if excluded == 1 else f"{excluded} rows are"
    remark = Remark("rows-excluded", f"{rows} excluded: the status is not ok")
    return table.rows(table.answered), [remark]


def _remarks_on(case: Case, table: Table) -> list[Remark]:
    """Several runs, and grousers that the model lacks."""
    notes: list[Remark] = []
    runs = len(np.unique(table["run"])) if "run" in table else 1
    if runs > 1:
        notes.append(Remark("runs-as-one-soil", f"{runs} runs are fitted as one soil"))
    lugs = QUANTITIES["grouser_height"].column
    gears = {name: case.of_gear(name) for name in case.gears} or {"": case}
    for name, own in gears.items() if lugs in table else ():
        named = name and "gear" in table
        heights = table[lugs][operating_points(table).gear == name] if named else table[lugs]
        height = float(np.nanmax(heights, initial=0.0))
        if height > 0.0 and not any(effect.name == "grousers" for effect in own.model.effects):
            owner = f"the gear {name}" if name else "the model"
            text = f"{lugs} is {height:g}, but {owner} has no effect grousers"
            notes.append(Remark("grousers-missing", text, ("grousers",)))
    return notes
