"""From logs and a map to a table of runs."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from soilml.errors import FitError, InputError
from soilml.io.table import Table
from soilml.log_import.channels.runs import runs_of, runs_of_rows
from soilml.log_import.channels.wheel_quantities import largest_errors
from soilml.log_import.guesses.role_words import is_size
from soilml.log_import.mapping.log_map import LogMap, map_from, read_map
from soilml.log_import.readers import Progress, read_logs, silent
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.recording import Recording
from soilml.log_import.result import ImportedLog
from soilml.log_import.rows import rows_as_table
from soilml.log_import.units import dimension
from soilml.log_import.wheel_rows import WheelRows
from soilml.quantities import column
from soilml.remarks import Remark

PathLike = str | os.PathLike[str]
_MOST_SIZES = 12  # Most sizes of wheels in one table
_MOST_LEFT = 5  # Most rows of tables of which is said why they are left out


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
    said, files = progress or silent, log_files(logs)
    if isinstance(log_map, LogMap):
        found = log_map
    else:
        found = map_from(log_map) if isinstance(log_map, Mapping) else read_map(log_map)
    recordings, steady = read_logs(files, said), found.runs.each_row
    runs = runs_of_rows(recordings, found) if steady else runs_of(recordings, found)
    wheels = [WheelRows(found, wheel, runs, said) for wheel in found.wheels]
    by_run = [one for of_run in zip(*(w.runs for w in wheels), strict=True) for one in of_run]
    wrong = [hint for wheel in wheels for hint in wheel.hints()]
    if wrong and not accept:
        raise InputError(f"{wrong[0]} (or pass --accept to import it as it is)")
    groups = [(one.wheel, one.source, one.kept) for one in by_run]
    table = rows_as_table(groups, found.source, timed=not steady)
    remarks = [remark for wheel in wheels for remark in wheel.remarks()]
    if len(table) == 0:
        if steady:
            raise InputError(f"{found.source}: no row can be used: {[*remarks, 'empty'][0]}")
        raise FitError(f"{found.source}: no steady window can be used: {_most_frequent(wheels)}")
    remarks = remarks[: _MOST_LEFT if steady else None]
    remarks += [*_lacks(table), *_several_wheels(table, recordings)]
    bias = largest_errors([wheel.shared_errors() for wheel in wheels])
    radii = {wheel.wheel.radius.value if wheel.wheel.radius else None for wheel in wheels}
    radius = radii.pop() if len(radii) == 1 else None
    for one in by_run:
        one.source = replace(one.source, recordings=(), times=())  # a result keeps no log
    return ImportedLog(
        table=table,
        bias=bias,
        series=() if steady else tuple(by_run),
        remarks=tuple(dict.fromkeys(remarks)),
        implausible=tuple(wrong),
        radius=radius or float("nan"),
        sources=tuple(str(log[0].file) for log in recordings),
        map_name=found.source,
    )


def _most_frequent(wheels: Sequence[WheelRows]) -> str:
    """The reason for which most of the time was left out."""
    seconds: dict[Remark | None, float] = {}
    for s in (s for wheel in wheels for one in wheel.runs for s in one.left_out):
        seconds[s.why] = seconds.get(s.why, 0.0) + s.stop - s.start
    most = max(seconds, key=lambda why: seconds[why], default=None)
    return most.text if most else "the logs are empty"


def _lacks(table: Table) -> Iterator[Remark]:
    """A remark where no row has a torque, without which there is no estimate on board."""
    if not np.isfinite(table[column("torque")]).any():
        text = (
            "no row has a torque: give the map a [torque] or [motor_current]; estimate needs one, "
            "and identify a torque, a drawbar pull or a sinkage"
        )
        yield Remark("no-torque", text, ("torque",))


def _several_wheels(table: Table, logs: Sequence[Sequence[Recording]]) -> list[Remark]:
    """A remark on columns that say that the rows are of wheels of several sizes."""
    sizes: dict[str, set[float]] = {}
    for recording in (own for log in logs for own in log):
        for name, values in recording.columns.items():
            if is_size(name) and dimension(recording.units.get(name, "m")) == "m":
                sizes.setdefault(name, set()).update(np.unique(values[np.isfinite(values)]))
    named = "gear" in table or "wheel" in table
    for name, found in sizes.items():
        if 1 < len(found) <= _MOST_SIZES and not named:
            text = (
                f"the column {name!r} says {', '.join(f'{size:g}' for size in sorted(found)[:4])}: "
                "rows of several wheels. Give each a table and a map of its own, with its radius "
                "and [wheel] gear = 'NAME'; one model of one wheel is no model of them all"
            )
            return [Remark("several-wheels", text, ("wheel_radius",))]
    return []
