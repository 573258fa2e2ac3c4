"""Tables in which each row is one steady run already, under other names and in other units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.log_import.channels.gear_of_run import wheels_by_gear
from soilml.log_import.channels.inputs import channel_constant, our_slip
from soilml.log_import.channels.runs import Run, run_names
from soilml.log_import.channels.shared_errors import SharedError, largest_errors
from soilml.log_import.channels.wheel_quantities import slope_of
from soilml.log_import.checks.column_units import unit_hints
from soilml.log_import.checks.map_hints import map_hints
from soilml.log_import.checks.table_hints import table_hints
from soilml.log_import.guesses.columns import words_of
from soilml.log_import.guesses.other_columns import with_other_columns
from soilml.log_import.mapping.channel_map import ChannelMap
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.recording import Recording
from soilml.log_import.result import ImportedLog
from soilml.log_import.rows import (
    AVERAGED,
    WindowRow,
    plain_constants,
    quantities_of,
    rows_as_table,
    shared_errors_of,
    unusable,
    values_of,
    without_torque,
)
from soilml.log_import.units import dimension
from soilml.log_import.windows.steady import Stretch
from soilml.quantities import column
from soilml.remarks import Remark

_OF_THE_WHEEL = ("wheel_radius_m", "wheel_width_m")  # Columns of logs that rows keep
_SIZES = {"radius", "diameter", "durchmesser", "radio", "rayon", "raggio", "dia", "diam", "width"}
_OF_SAMPLES = ("wheel_angle", "position")  # Channels that only samples over time can be


def import_rows(
    logs: Sequence[Sequence[Recording]], log_map: LogMap, accept: bool = False
) -> ImportedLog:
    """Bring tables of steady runs into our table of runs.

    Standard deviations are those of the columns `std` of the map, with its `noise` in addition; a
    remark names the quantities that have none.

    Raises `InputError` where a column is missing, a channel needs samples over time, the map is
    implausible (unless `accept`), or no row can be used.
    """
    names = run_names([log[0].file for log in logs])
    groups: list[tuple[WheelMap, Run, Sequence[WindowRow]]] = []
    left: list[Remark] = []
    wrong: list[Remark] = []
    errors: list[tuple[dict[str, Noise], list[SharedError]]] = []
    for wheel in log_map.wheels:
        rows_of: dict[str, tuple[WheelMap, list[WindowRow], list[WindowRow]]] = {}
        for name, log in zip(names, logs, strict=True):
            for recording in log:
                run = Run(name, (recording,), (np.arange(float(len(recording))),))
                labelled = [replace(run, name=label) for label in _labels(run, log_map)]
                found: dict[int, tuple[WheelMap, WindowRow]] = {}
                for own, picked in wheels_by_gear(log_map, wheel, labelled):
                    of_gear = _rows(run, own, log_map)
                    found |= {i: (own, of_gear[i]) for i in picked}
                for i, (own, row) in sorted(found.items()):
                    _, every, rows = rows_of.setdefault(own.gear, (own, [], []))
                    every.append(row)
                    if why := unusable(row, {}):
                        text = f"row {i + 1} of {recording.file.name} is left out: {why}"
                        left.append(replace(why, text=text))
                        continue
                    groups.append((own, labelled[i], [row]))
                    rows.append(row)
        first = Run(names[0], tuple(logs[0]), tuple(np.arange(float(len(r))) for r in logs[0]))
        for own, every, rows in rows_of.values():
            hints = unit_hints(log_map, own, first)
            hints += map_hints(log_map, own, values_of(every))
            wrong += with_other_columns(hints, own, first, steady=True)
            errors.append(shared_errors_of(log_map, own, rows))
    if wrong and not accept:
        raise InputError(f"{wrong[0]} (or pass --accept to import it as it is)")
    if not groups:
        raise InputError(f"{log_map.source}: no row can be used: {left[0] if left else 'empty'}")
    table = rows_as_table(groups, log_map)
    kept = {k: v for k, v in table.columns.items() if k != "time_s"}
    table = Table(kept | _geometry(groups), table.source)
    bias, parts = largest_errors(errors)
    radii = {wheel.radius.value if wheel.radius else None for wheel, _, _ in groups}
    radius = radii.pop() if len(radii) == 1 else None
    remarks = [*left[:5], *without_torque(table), *_without_errors(table)]
    remarks += _several_wheels(table, logs)
    remarks += table_hints(table.columns, table.columns.get("wheel_radius_m"))
    return ImportedLog(
        table=table,
        bias=bias,
        shared=tuple(parts),
        series=(),
        remarks=tuple(dict.fromkeys(remarks)),
        implausible=tuple(wrong),
        radius=radius or float("nan"),
        sources=tuple(str(log[0].file) for log in logs),
        map_name=log_map.source,
    )


def _labels(run: Run, log_map: LogMap) -> list[str]:
    """Name of the run of each row: by [runs] column, or that of the file."""
    (recording,) = run.recordings
    name = log_map.runs.column
    if not name:
        return [run.name] * len(recording)
    if name in recording.texts:
        return [cell or "unnamed" for cell in recording.texts[name]]
    return [f"{value:g}" for value in run.find(name)[1]]


def _rows(run: Run, wheel: WheelMap, log_map: LogMap) -> list[WindowRow]:
    """The rows of a table with their standard deviations."""
    count = len(run.recordings[0])
    means: dict[str, Floats] = {}
    errors: dict[str, Floats] = {}
    for role, channel in wheel.channels.items():
        if role in _OF_SAMPLES or channel.tare is not None:
            raise InputError(
                f"{log_map.source}: [{role}] needs samples over time, and [runs] each_row says "
                "that each row is a steady run; needed is a speed or [slip], and no tare"
            )
        means[role], errors[role] = _channel(run, channel, count)
    constants = plain_constants(log_map, wheel)
    values = quantities_of(dict(means), log_map, wheel, constants)
    std: dict[str, Floats] = {}
    for role, error in errors.items():
        if not np.any(error > 0.0):
            continue
        changed = means[role] + np.nan_to_num(error)
        moved = quantities_of({**means, role: changed}, log_map, wheel, constants)
        for name in ("slip", *AVERAGED):
            if name in moved:
                change = np.abs(moved[name] - values[name])
                std[name] = np.hypot(std.get(name, np.zeros(count)), change)

    def at(found: Mapping[str, Floats], i: int) -> dict[str, float]:
        return {k: float(np.broadcast_to(v, (count,))[i]) for k, v in found.items()}

    return [
        WindowRow(
            Stretch(float(i), float(i)), at(means, i), at(values, i),
            {k: v for k, v in at(std, i).items() if v > 0.0},
        )
        for i in range(count)
    ]  # fmt: skip


def _channel(run: Run, channel: ChannelMap, count: int) -> tuple[Floats, Floats]:
    """Readings (rows,) in the units of soilml, and their standard errors, 0 where not known."""
    if not channel.columns:
        return np.full(count, channel_constant(run, channel)), np.zeros(count)
    read = [run.find(address)[1] for address in channel.columns]
    if channel.role == "slope":
        given = channel.scale * slope_of(read)
    else:
        given = channel.scale * sum(read[1:], start=read[0])
        given = given / len(read) if channel.role == "sinkage" else given
    error = np.asarray(channel.noise.std(given), dtype=np.float64) * np.ones(count)
    if channel.std_column:
        stated = channel.std_scale * np.abs(run.find(channel.std_column)[1])
        stated = stated * np.abs(given) if channel.std_is_share else stated
        error = np.hypot(error, np.nan_to_num(stated))
    if channel.role != "slip":
        return given, error
    ours = our_slip(given, channel.definition)
    return ours, np.abs(our_slip(given + error, channel.definition) - ours)


def _geometry(
    groups: Sequence[tuple[WheelMap, Run, Sequence[WindowRow]]],
) -> dict[str, Floats]:
    """Radius and width of the wheel of each row, where the logs have columns of these names."""
    found = {}
    for name in _OF_THE_WHEEL:
        values = [
            float(recording.columns[name][int(row.window.start)])
            if name in recording.columns else np.nan
            for _, run, rows in groups for recording in run.recordings[:1] for row in rows
        ]  # fmt: skip
        if np.isfinite(values).any():
            found[name] = np.asarray(values)
    return found


def _several_wheels(table: Table, logs: Sequence[Sequence[Recording]]) -> list[Remark]:
    """A remark on columns that say that the rows are of wheels of several sizes."""
    if "gear" in table:
        return []
    for recording in (own for log in logs for own in log):
        for name, values in recording.columns.items():
            words = {*words_of(name)}
            sizes = np.unique(values[np.isfinite(values)])
            plate = recording.units.get(name, "m")
            if not words & _SIZES or sizes.size < 2 or dimension(plate) != "m":
                continue
            shown = ", ".join(f"{size:g}" for size in sizes[:4])
            text = (
                f"the column {name!r} says {shown}: rows of several wheels. Give each a gear "
                "([wheel] gear_from, [gears.NAME]), or a table of its own; one model of one wheel "
                "is no model of them all"
            )
            return [Remark("several-wheels", text, ("wheel_radius",))]
    return []


def _without_errors(table: Table) -> list[Remark]:
    """A remark on measured quantities that no column gives a standard error of."""
    bare = [
        name for name in ("torque", "drawbar_pull", "sinkage")
        if column(name) in table and np.isfinite(table[column(name)]).any()
        and f"{column(name)}_std" not in table
    ]  # fmt: skip
    if not bare:
        return []
    lines = ", ".join(f"{column(name)} = '5 %'" for name in bare)
    shown = ", ".join(f"[{name}]" for name in bare)
    text = (
        f"no standard errors of {shown}: name their columns (std = 'COLUMN'), write noise = '5 %' "
        f"there, or declare them in the model file, as [noise] {lines}: estimates are no better "
        "than this number"
    )
    return [Remark("no-standard-errors", text, tuple(bare))]
