"""Rows of windows as a table of runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from soilml.io.table import Table
from soilml.log_import.channels.runs import Run
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.window_rows import WindowRow
from soilml.quantities import column

#: Largest slip of a row: at 1 the wheel spins on the spot, and r omega and v say no more.
_MOST_SLIP = 0.995


def unusable(row: WindowRow, dead: Mapping[str, str]) -> str:
    """Why a window cannot be a row; "" where it can."""
    for name in ("slip", "load"):
        if not np.isfinite(row.values.get(name, np.nan)):
            role = next((r for r in dead if r == name), "")
            return f"its {name} is not known{f': {dead[role]}' if role else ''}"
    if not abs(row.values["slip"]) < _MOST_SLIP:
        return f"its slip is {row.values['slip']:.3g}: the wheel spins on the spot, or locks"
    if row.values["load"] <= 0.0:
        return f"its load is {row.values['load']:.3g} N"
    measured = [row.values.get(n, np.nan) for n in ("torque", "drawbar_pull", "sinkage")]
    if not np.isfinite(measured).any() and dead:
        role, why = next(iter(dead.items()))
        return f"the sensor of [{role}] is dead: {why}"
    return ""


def without_torque(table: Table) -> list[str]:
    """A remark where no row has a torque, without which there is no estimate on board."""
    if np.isfinite(table[column("torque")]).any():
        return []
    return [
        "no row has a torque: give the map a [torque] or [motor_current]; estimate needs one, and "
        "identify a torque, a drawbar pull or a sinkage"
    ]


def rows_as_table(
    groups: Sequence[tuple[WheelMap, Run, Sequence[WindowRow]]], log_map: LogMap
) -> Table:
    """The table of all windows, in order of runs, wheels and time."""
    lines: list[dict[str, Any]] = []
    for wheel, run, rows in groups:
        for row in rows:
            line: dict[str, Any] = {"run": f"{run.name}_{wheel.name}" if wheel.name else run.name}
            if wheel.name:
                line["wheel"] = wheel.name
            if wheel.gear:
                line["gear"] = wheel.gear
            for name in ("slip", "load", "torque", "drawbar_pull", "sinkage"):
                if name in row.values:
                    line[column(name)] = row.values[name]
                    line[f"{column(name)}_std"] = row.std.get(name, float("nan"))
            if "speed" in row.values:
                line[column("speed")] = row.values["speed"]
            line[column("time")] = (row.window.start + row.window.stop) / 2.0
            if wheel.radius is not None:
                # a model file of another wheel is refused, since slip is that of this radius
                line[column("wheel_radius")] = wheel.radius.value
            line["source"] = run.recordings[0].file.name
            lines.append(line)
    names = list(dict.fromkeys(name for line in lines for name in line))
    text = ("run", "wheel", "gear", "source")
    columns: dict[str, Any] = {}
    for name in names:
        if name in text:
            columns[name] = np.asarray([line.get(name, "") for line in lines], dtype=np.str_)
        else:
            columns[name] = np.asarray([line.get(name, np.nan) for line in lines], dtype=float)
    if lines and "torque_Nm" not in columns:
        columns["torque_Nm"] = np.full(len(lines), np.nan)
    columns = {
        name: values
        for name, values in columns.items()
        if name == "torque_Nm" or name in text or np.isfinite(values).any()
    }
    return Table(columns, log_map.source)
