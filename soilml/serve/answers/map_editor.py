"""The map of a log on the page: its columns with their roles, changes of it, and what it gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError, SoilmlError
from soilml.log_import.channels.runs import as_rows, runs_of
from soilml.log_import.guesses.channel_drafts import draft_channels
from soilml.log_import.guesses.columns import Candidate, candidates_of, liveliest
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import LogMap, map_from, read_map
from soilml.log_import.mapping.written_map import (
    channels_of,
    columns_in,
    open_lines,
    parsed,
    set_value,
    with_channel,
    with_unit,
)
from soilml.log_import.new_map import draft_map
from soilml.log_import.readers import read_log
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.result import ImportedLog
from soilml.log_import.rows import WheelSeries
from soilml.log_import.workflow import import_log
from soilml.serve.answers.job_files import Tell, setting_file

MAP_FILE = "map.toml"  # Name of the map in messages
_SPARK, _DRAWN = 60, 400  # Points of a picture of a column, and of a curve
_MOST_COLUMNS = 200
_ANY_SLIP = 0.2  # Slip of a map that lacks the radius; it is not drawn
#: Units to choose from, by the unit of soilml.
UNITS: dict[str, tuple[str, ...]] = {
    "rad/s": ("rad/s", "deg/s", "rpm", "count/s"), "rad": ("rad", "deg", "count"),
    "m/s": ("m/s", "mm/s", "cm/s"), "m": ("m", "mm", "cm"), "1": ("1", "%"),
    "N m": ("N m", "mN m", "kgf cm"), "A": ("A", "mA"), "N": ("N", "kN", "kgf", "gf"),
}  # fmt: skip
#: Curves that are drawn: quantity and unit.
_CURVES = (("slip", ""), ("load", "N"), ("torque", "N m"))


def edit(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The map after a change, its columns, what is open in it, and the curves that it gives.

    Without a `map` in the request it is guessed. `change` is one of {column, role, unit}, {role,
    unit} and {line, value}.

    Raises `InputError` for logs that cannot be read, a map that is no TOML, and a change that is
    not possible; what is wrong with the map otherwise is part of the answer.
    """
    tell("looking at the log")
    names = [str(file) for file in log_files(request["names"])]
    text = request.get("map")
    if not isinstance(text, str) or not text.strip():
        text = draft_map(names).text
    look = _Look(names, text)
    change = request.get("change") or {}
    if change:
        text = _changed(text, change, look)
        look = _Look(names, text)
    tell("computing slip, load and torque")
    return {
        "map": text,
        "marked": len(open_lines(text)),
        "open": [vars(line) for line in open_lines(text)],
        "roles": _roles(look.content),
        "units": UNITS,
        "columns": [
            _column(column, samples, look)
            for column, samples in zip(look.columns, look.samples, strict=True)
        ][:_MOST_COLUMNS],
        "more": max(0, len(look.columns) - _MOST_COLUMNS),
        "preview": _preview(names, look),
    }


class _Look:
    """Logs as a map reads them: the run that is drawn, its columns, and the map's channels.

    Where the radius alone is missing, the map has a constant slip, so that load and torque can be
    drawn.
    """

    def __init__(self, names: Sequence[str], text: str) -> None:
        self.content = parsed(text)
        self.map: LogMap | None = None
        self.fault = ""
        path = Path(MAP_FILE)
        path.unlink(missing_ok=True)
        try:
            self.map = read_map(setting_file(MAP_FILE, text))
        except InputError as error:
            self.fault = str(error)
            self.map = self._without_slip()
        # what is wrong with its channels does not hide the columns
        logs = [read_log(name) for name in names[: None if self.content.get("files") else 1]]
        steady = self.map is not None and self.map.runs.each_row
        try:
            runs = [] if steady else runs_of(logs, self.map or LogMap(MAP_FILE))
        except InputError as error:
            self.fault = self.fault or str(error)
            runs = []
        runs = runs or [as_rows(log, "log") for log in logs]
        run = liveliest(runs)
        self.run = run
        self.columns = candidates_of(run.recordings, steady)
        self.samples = [values for own in run.recordings for values in own.columns.values()]

    def _without_slip(self) -> LogMap | None:
        wheel = self.content.get("wheel", {})
        if not isinstance(wheel, dict) or {"radius", "diameter"} & wheel.keys():
            return None
        try:
            return map_from({**self.content, "slip": {"value": _ANY_SLIP}})
        except InputError:
            return None


def _changed(text: str, change: Mapping[str, Any], look: _Look) -> str:
    given = {k: str(change.get(k) or "") for k in ("column", "role", "unit", "value")}
    if "line" in change:
        line = change["line"]
        if isinstance(line, bool) or not isinstance(line, int | float):
            raise InputError("line: needed is the number of a line of the map")
        return set_value(text, int(line), given["value"])
    if "column" in change:
        return _with_role(text, look, given["column"], given["role"], given["unit"])
    return with_unit(text, given["role"], given["unit"])


def _with_role(text: str, look: _Look, address: str, path: str, unit: str) -> str:
    """The map with a column in another role: its unit, sign and tare as its samples show them."""
    known = {c.address: c for c in look.columns}
    parent, _, role = path.rpartition(".")
    if address not in known or (path and role not in ROLES):
        raise InputError(f"column {address!r}, channel {path!r}: one of them is not known")
    if not path:
        return with_channel(text, address, None)
    chosen = {role: known[address]}
    for other, table in channels_of(look.content).items():
        above, _, own = other.rpartition(".")
        used = columns_in(table)
        if above == parent and own != role and used and used[0] in known and used[0] != address:
            chosen[own] = known[used[0]]
    drafted = draft_channels(chosen, look.run, {})[role]
    drafted.path, drafted.about = path, ROLES[role][1]
    if unit:
        drafted.keys.pop("scale", None)
        drafted.comments.pop("unit", None)
        drafted.put("unit", unit)
    return with_channel(text, address, drafted)


def _roles(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """The channels that a column may be, by path."""
    wheels = content.get("wheels")
    names = [*wheels] if isinstance(wheels, dict) else []
    found = [{"id": role, "label": _words(role), "unit": ROLES[role][0]} for role in ROLES]
    for name in names:
        of = f"{_words(name)}: "
        found += [
            {"id": f"wheels.{name}.{role}", "label": of + _words(role), "unit": ROLES[role][0]}
            for role in ROLES
        ]
    return found


def _words(name: str) -> str:
    return name.replace("_", " ")


def _column(column: Candidate, samples: Floats, look: _Look) -> dict[str, Any]:
    """A column with its picture, its role and what is marked of it."""
    channels = channels_of(look.content)
    path = next((p for p, t in channels.items() if column.address in columns_in(t)), "")
    role = path.rpartition(".")[2]
    shared = channels.get(role, {})
    own = {**shared, **channels.get(path, {})}
    clock = look.map is not None and column.name == look.map.time.column
    return {
        "name": column.address,
        "stated": column.unit,
        "low": column.about.low,
        "high": column.about.high,
        "constant": column.about.constant,
        "spark": _thinned(samples, _SPARK).tolist(),
        "role": "time" if clock else path,
        "unit": str(own.get("unit", "")),
        "scaled": "scale" in own,
    }


def _thinned(values: Floats, most: int) -> Floats:
    """At most so many samples, evenly over the whole."""
    if values.size <= most:
        return values
    return np.asarray(values[np.linspace(0, values.size - 1, most).astype(int)])


def _preview(names: Sequence[str], look: _Look) -> dict[str, Any]:
    """The curves of the first log, what physics objects to, or the error in words."""
    fault = " ".join(look.fault.split())
    if look.map is None:
        return {"error": fault}
    first = names[:1] if not look.map.files else names
    try:
        found = import_log(list(first), look.map, accept=True)
    except SoilmlError as error:
        return {"error": fault or " ".join(str(error).split())}
    if fault:
        return {"error": fault, "curves": [c for c in _curves(found) if c["quantity"] != "slip"]}
    hints = [
        {"text": hint.text, "about": list(hint.about), "wrong": hint in found.implausible}
        for hint in (*found.implausible, *found.remarks)
    ]
    return {
        "error": "",
        "hints": hints,
        "rows": len(found.table),
        "logs": len(names),
        "log": Path(first[0]).name,
        "curves": _curves(found),
    }


def _curves(found: ImportedLog) -> list[dict[str, Any]]:
    """Slip, load and torque over time, and the share of them that is in steady windows."""
    if not found.series:
        return []
    series = max(found.series, key=lambda one: sum(not s.why for s in one.stretches))
    return [
        {"quantity": name, "unit": unit, "run": series.run, **_curve(series, name)}
        for name, unit in _CURVES
        if name in series.quantities
    ]


def _curve(series: WheelSeries, name: str) -> dict[str, Any]:
    time, values = series.time, np.asarray(series.quantities[name], dtype=np.float64)
    width = max(1, time.size // _DRAWN)
    count = time.size // width
    # means of blocks, so that noise is no band of black
    blocks = values[: count * width].reshape(count, width)
    known = np.isfinite(blocks)
    total = np.where(known, blocks, 0.0).sum(axis=1)
    shown = np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)
    at = time[: count * width].reshape(count, width).mean(axis=1)
    steady, resting = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    for stretch in series.stretches:
        within = (at >= stretch.start) & (at <= stretch.stop)
        if stretch.why is None:
            steady |= within
        resting |= within & (stretch.why is not None and stretch.why.code == "at-rest")
    if name == "slip":  # at rest it is any number
        shown = np.where((np.abs(shown) <= 1.0) & ~resting, shown, np.nan)
    return {
        "time": at.tolist(),
        "values": shown.tolist(),
        "steady": np.where(steady, shown, np.nan).tolist(),
    }
