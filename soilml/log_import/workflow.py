"""From logs and a map to a table of runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.log_import.channels.gear_of_run import wheels_by_gear
from soilml.log_import.channels.inputs import Inputs, wheel_inputs
from soilml.log_import.channels.runs import Run, runs_of
from soilml.log_import.channels.shared_errors import largest_errors
from soilml.log_import.checks.column_units import differing_units, unit_hints
from soilml.log_import.checks.map_hints import map_hints
from soilml.log_import.checks.sensors import (
    dead_sensors,
    lifted_at_the_end,
    untared_load,
    untared_sensors,
)
from soilml.log_import.checks.table_hints import table_hints
from soilml.log_import.guesses.columns import liveliest
from soilml.log_import.guesses.other_columns import with_other_columns
from soilml.log_import.mapping.log_map import LogMap, WheelMap, map_from, read_map
from soilml.log_import.readers import read_log
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.recording import Recording
from soilml.log_import.result import ImportedLog
from soilml.log_import.row_import import import_rows
from soilml.log_import.rows import (
    WheelSeries,
    WindowRow,
    add_stated_errors,
    irregular_windows,
    plain_constants,
    pool_errors,
    quantities_of,
    rows_as_table,
    shared_errors_of,
    unusable,
    values_of,
    window_row,
    without_torque,
)
from soilml.log_import.stance_rows import stance_rows, without_rolling
from soilml.log_import.windows.steady import Stretch, steady_windows
from soilml.remarks import Remark

PathLike = str | os.PathLike[str]
_LOOKED = 8  # Runs among which a lively one is looked for
Progress = Callable[[str, int, int], None]


def import_log(
    logs: PathLike | Sequence[PathLike],
    log_map: PathLike | LogMap | Mapping[str, Any],
    *,
    accept: bool = False,
    progress: Progress | None = None,
) -> ImportedLog:
    """Bring logs of a rig or rover into a table of runs.

    Parameters
    ----------
    logs
        One or several files: CSV and other text, Parquet, spreadsheets (one sheet as
        `BOOK.xlsx#SHEET`), MATLAB, MCAP, bags of ROS 1 and 2.
    log_map
        The map: a TOML file, its content as a dictionary, or what `read_map` returns. `init_map`
        writes one.
    accept
        Give the table although the map looks wrong.
    progress
        Called with a stage, the items done and their number.

    Returns
    -------
    ImportedLog
        With one row for each steady window of each wheel; `table` is a table of runs.

    Raises
    ------
    InputError
        Where a file cannot be read, a column is missing, or the map is implausible: the line names
        the likely cause.
    FitError
        Where no window can be used.
    MissingLibraryError
        Where a reader's library is not installed.
    """
    tell = progress or (lambda stage, done, total: None)
    files = log_files(logs)
    found = _as_map(log_map)
    recordings = []
    for i, file in enumerate(files):
        tell("reading logs", i, len(files))
        recordings.append(read_log(Path(file)))
    tell("reading logs", len(files), len(files))
    return import_recordings(recordings, found, accept, tell)


def import_recordings(
    recordings: Sequence[Sequence[Recording]],
    found: LogMap,
    accept: bool = False,
    tell: Progress = lambda stage, done, total: None,
) -> ImportedLog:
    """What `import_log` gives, of logs that are read already; raises as it does."""
    if found.runs.each_row:
        return import_rows(recordings, found, accept)
    runs = runs_of(recordings, found)
    parts_of_wheels = [part for w in found.wheels for part in wheels_by_gear(found, w, runs)]
    analyses = [
        _Wheel(found, wheel, [runs[i] for i in own], tell) for wheel, own in parts_of_wheels
    ]
    # by run: its wheels, each in the analysis that has its gear, and the run's place there
    by_run = [
        (run, analysis, own.index(i))
        for i, run in enumerate(runs)
        for analysis, (_, own) in zip(analyses, parts_of_wheels, strict=True)
        if i in own
    ]
    wrong = [hint for analysis in analyses for hint in analysis.map_hints()]
    if wrong and not accept:
        raise InputError(f"{wrong[0]} (or pass --accept to import it as it is)")
    table = rows_as_table([(a.wheel, run, a.kept[k]) for run, a, k in by_run], found)
    if len(table) == 0:
        raise FitError(f"{found.source}: no steady window can be used: {_most_frequent(analyses)}")
    bias, parts = largest_errors(
        [shared_errors_of(found, a.wheel, [row for own in a.kept for row in own]) for a in analyses]
    )
    radii = {a.wheel.radius.value if a.wheel.radius else None for a in analyses}
    radius = radii.pop() if len(radii) == 1 else None
    remarks = [remark for analysis in analyses for remark in analysis.remarks()]
    remarks += without_torque(table)
    remarks += table_hints(table.columns, table.columns.get("wheel_radius_m"))
    return ImportedLog(
        table=table,
        bias=bias,
        shared=tuple(parts),
        series=tuple(a.series(k) for _, a, k in by_run),
        remarks=tuple(dict.fromkeys(remarks)),
        implausible=tuple(wrong),
        radius=radius or float("nan"),
        sources=tuple(str(log[0].file) for log in recordings),
        map_name=found.source,
    )


def _as_map(log_map: PathLike | LogMap | Mapping[str, Any]) -> LogMap:
    if isinstance(log_map, LogMap):
        return log_map
    return map_from(log_map) if isinstance(log_map, Mapping) else read_map(log_map)


class _Wheel:
    """One wheel in all runs."""

    def __init__(
        self, log_map: LogMap, wheel: WheelMap, runs: Sequence[Run], tell: Progress
    ) -> None:
        self.log_map, self.wheel, self.runs = log_map, wheel, runs
        self.inputs = [wheel_inputs(run, wheel) for run in runs]
        self.dead = dead_sensors(self.inputs)
        # the slip of stances may be what is asked for
        self.needs_slip = wheel.leg is None
        self.quantities: list[dict[str, Floats]] = []
        self.stretches: list[list[Stretch]] = []
        self.rows: list[list[WindowRow]] = []
        stage = f"finding steady windows{' of ' + wheel.name if wheel.name else ''}"
        for i, run in enumerate(runs):
            tell(stage, i, len(runs))
            self._analyse(run, self.inputs[i], self.dead[i])
        tell(stage, len(runs), len(runs))
        self._sort_out()

    def _analyse(self, run: Run, inputs: Inputs, dead: Mapping[str, str]) -> None:
        for role in dead:
            inputs.values[role] = np.full(inputs.time.size, np.nan)
        angle = without_rolling(inputs, self.wheel) if self.wheel.leg is not None else None
        values: dict[str, float | Floats] = {**inputs.values, **inputs.constants}
        constants = plain_constants(self.log_map, self.wheel)
        quantities = quantities_of(values, self.log_map, self.wheel, constants)
        series = {
            name: np.broadcast_to(values, inputs.time.shape) for name, values in quantities.items()
        }
        left_out = tuple(e for e in self.log_map.left_out if e.run in ("", run.name))
        if angle is not None:
            out, rows = stance_rows(inputs, angle, series, self.log_map, self.wheel, left_out)
            self.quantities.append(series)
            self.stretches.append(out)
            self.rows.append(rows)
            return
        stretches = steady_windows(inputs.time, series, self.log_map.windows, left_out)
        rows = [
            window_row(stretch, inputs, quantities, self.log_map, self.wheel)
            for stretch in stretches
            if not stretch.why
        ]
        self.quantities.append(series)
        self.stretches.append([s for s in stretches if s.why])
        self.rows.append(rows)

    def _sort_out(self) -> None:
        """Leave out windows without slip or load, and irregular ones."""
        self.kept: list[list[WindowRow]] = []
        odd = irregular_windows(self.rows)
        pool_errors([row for i, rows in enumerate(self.rows) for k, row in enumerate(rows)
                     if (i, k) not in odd])  # fmt: skip
        for inputs, rows in zip(self.inputs, self.rows, strict=True):
            for row in rows:
                add_stated_errors(row, inputs, self.log_map, self.wheel)
        for i, rows in enumerate(self.rows):
            kept = []
            for k, row in enumerate(rows):
                needed = ("slip", "load") if self.needs_slip else ("load",)
                why = unusable(row, self.dead[i], needed) or odd.get((i, k))
                if why:
                    self.stretches[i].append(replace(row.window, why=why))
                else:
                    kept.append(row)
            self.kept.append(kept)

    def map_hints(self) -> list[Remark]:
        """What says that the map is wrong."""
        # all windows, left out or not
        windows = values_of([row for rows in self.rows for row in rows])
        hints = unit_hints(self.log_map, self.wheel, self.runs[0])
        hints += map_hints(self.log_map, self.wheel, windows)
        return with_other_columns(hints, self.wheel, liveliest(self.runs[:_LOOKED]))

    def remarks(self) -> list[Remark]:
        """Dead and untared sensors."""
        of = f" of wheel {self.wheel.name}" if self.wheel.name else ""
        found = []
        for run, dead, inputs in zip(self.runs, self.dead, self.inputs, strict=True):
            if len(dead) > 2 and len(dead) >= len(inputs.values) - 1:
                text = f"run {run.name}: no sensor{of} says anything: an empty log?"
                found.append(Remark("empty-log", text, (run.name,)))
                continue
            for role, why in dead.items():
                text = f"run {run.name}: the sensor of [{role}]{of} is dead: {why}"
                found.append(Remark("dead-sensor", text, (role, run.name)))
        found += untared_sensors(self.wheel, self.inputs)
        found += untared_load(self.wheel, self.inputs)
        found += differing_units(self.wheel, self.runs[0])
        return found + lifted_at_the_end(self.wheel, [run.name for run in self.runs], self.inputs)

    def series(self, i: int) -> WheelSeries:
        """Quantities and stretches of one run."""
        run = self.runs[i]
        windows = [row.window for row in self.kept[i]]
        notes = (*run.notes, *self.inputs[i].notes)
        notes += tuple(
            Remark("dead-sensor", f"[{role}] is dead: {why}", (role,))
            for role, why in self.dead[i].items()
        )
        return WheelSeries(
            run=f"{run.name}_{self.wheel.name}" if self.wheel.name else run.name,
            drive=run.name,
            time=self.inputs[i].time,
            quantities=self.quantities[i],
            stretches=tuple(sorted([*self.stretches[i], *windows], key=lambda s: s.start)),
            notes=notes,
        )


def _most_frequent(analyses: Sequence[_Wheel]) -> str:
    """The reason for which most of the time was left out."""
    left_out = [s for analysis in analyses for own in analysis.stretches for s in own]
    seconds: dict[Remark | None, float] = {}
    for s in left_out:
        seconds[s.why] = seconds.get(s.why, 0.0) + s.stop - s.start
    most = max(seconds, key=lambda why: seconds[why], default=None)
    return most.text if most else "the logs are empty"
