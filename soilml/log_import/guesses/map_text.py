"""A commented map for logs that nobody has described: `soilml import --init`."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from soilml.errors import InputError, SoilmlError
from soilml.log_import.channels.runs import Run, run_names, runs_of
from soilml.log_import.guesses.assignment import Assignment, assign, axle_of
from soilml.log_import.guesses.behaviour import time_unit
from soilml.log_import.guesses.candidates import Candidate, candidates_of
from soilml.log_import.guesses.draft import (
    Draft,
    describe,
    draft_channels,
    fastest_ratio,
    inputs_of,
)
from soilml.log_import.guesses.file_kinds import clocks_differ, guess_file_kinds
from soilml.log_import.guesses.stated_constants import number_in_names, stated_constants
from soilml.log_import.guesses.windows_guess import guess_windows
from soilml.log_import.mapping.channel import ROLES
from soilml.log_import.mapping.log_map import FileKind, LogMap
from soilml.log_import.readers import read_log
from soilml.log_import.recording import Recording

_MOST_LISTED = 40
#: Keys whose value is changed by nearly every user.
_WIDTH = 100


def init_map(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> str:
    """Look at logs and write a map with guesses, each with its reason, as TOML with comments.

    Guesses come from names, units and the behaviour of the values. What no log can tell, such as
    the radius, is marked with CHANGE or NEEDED.

    Raises `InputError` where a file cannot be read or has no columns.
    """
    files = [logs] if isinstance(logs, str | os.PathLike) else list(logs)
    if not files:
        raise InputError("no log was given; needed is at least one file")
    recordings = [read_log(Path(file)) for file in files]
    return _MapText(recordings).text()


class _MapText:
    """The map of some logs, section by section."""

    def __init__(self, logs: Sequence[Sequence[Recording]]) -> None:
        self.logs = logs
        self.kinds = guess_file_kinds(logs)
        self.time_column, self.time_unit, self.rate = self._time()
        about = [line for log in logs[:3] for recording in log for line in recording.about]
        self.stated = stated_constants(about)
        if not self.time_column and "rate" in self.stated:
            self.rate = float(self.stated["rate"][0].split()[0])
        self.kinds = self._with_clocks()
        self.runs = self._runs()
        self.columns = [
            c for c in candidates_of(self.runs[0].recordings) if c.name != self.time_column
        ]
        self.found: Assignment = assign(self.columns)
        self.run_names = [run.name for run in self.runs]

    def _time(self) -> tuple[str, str, float]:
        """Column of time and its unit; or a rate, where no column is one."""
        best: tuple[float, str, Any] = (0.0, "", None)
        for recording in (r for log in self.logs[:4] for r in log):
            if recording.clock is not None:
                return "", "s", 0.0
            for candidate in candidates_of([recording]):
                score = candidate.scores.get("time", 0.0)
                if score > best[0]:
                    unit = candidate.unit if candidate.kind == "s" else ""
                    values = recording.columns[candidate.name]
                    best = (score, candidate.name, unit or time_unit(values))
        if best[0] > 0.5:
            return best[1], best[2], 0.0
        return "", "s", 100.0

    def _map(self, kinds: Sequence[FileKind]) -> LogMap:
        return LogMap("map", (), tuple(kinds), self.time_column, self.time_unit, self.rate)

    def _with_clocks(self) -> tuple[FileKind, ...]:
        if not self.kinds:
            return ()
        try:
            run = runs_of(self.logs, self._map(self.kinds))[0]
        except SoilmlError:
            return ()
        if clocks_differ(self.logs, [(t[0], t[-1]) for t in run.times]):
            return tuple(FileKind(k.name, k.pattern, "start") for k in self.kinds)
        return self.kinds

    def _runs(self) -> list[Run]:
        return runs_of(self.logs, self._map(self.kinds))

    def text(self) -> str:
        """The whole map."""
        lines = self._head()
        lines += self._files() + self._time_lines() + self._run_column()
        groups = self.found.wheels or {"": {}}
        drafts = {
            name: draft_channels(self.found.shared | own, self.runs[0], self.stated)
            for name, own in groups.items()
        }
        first = next(iter(drafts.values()))
        lines += self._wheel(first)
        lines += self._load()
        for role in ROLES:
            if role in self.found.shared:
                lines += self._channel(f"[{role}]", role, first[role])
            elif role not in self.found.roles():
                lines += self._absent(role)
        for name, own in self.found.wheels.items():
            lines += ["", f"[wheels.{name}]"]
            if axle := axle_of(name):
                lines.append(f'axle = "{axle}"')
            for role in own:
                lines += self._channel(f"[wheels.{name}.{role}]", role, drafts[name][role])
        lines += guess_windows(self.runs, first)
        return "\n".join(lines) + "\n"

    def _head(self) -> list[str]:
        names = run_names([log[0].file for log in self.logs])
        shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        lines = [
            f"# Map of {len(names)} log{'s' if len(names) > 1 else ''}: {shown}",
            "# Written by `soilml import --init`. Everything here is a guess: look at the lines with",
            "# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:",
            '# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.',
            "#",
            "# The columns, with the unit that the log states and the range of their values:",
        ]
        lines += [f"#   {line}" for line in describe(self.columns[:_MOST_LISTED])]
        if len(self.columns) > _MOST_LISTED:
            lines.append(f"#   and {len(self.columns) - _MOST_LISTED} more")
        notes = dict.fromkeys(note for log in self.logs for r in log for note in r.notes)
        return lines + [f"# Note: {note}" for note in list(notes)[:5]]

    def _files(self) -> list[str]:
        lines = []
        for kind in self.kinds:
            lines += ["", f"[files.{kind.name}]", f"pattern = {_toml(kind.pattern)}"]
            why = "their clocks share no time: each starts at 0" if kind.clock == "start" else (
                "times can be compared; 'start' where each clock starts at 0"
            )  # fmt: skip
            lines.append(f'clock = "{kind.clock}"  # {why}')
        return lines

    def _time_lines(self) -> list[str]:
        if any(r.clock is not None for r in self.runs[0].recordings):
            return ["", "# Time comes from the messages."]
        if self.time_column:
            return [
                "",
                "[time]",
                f"column = {_toml(self.time_column)}",
                f"unit = {_toml(self.time_unit)}",
            ]
        stated = "stated in the log" if "rate" in self.stated else "CHANGE: no column is a clock"
        return ["", "[time]", f'rate = "{self.rate:g} Hz"  # {stated}']

    def _run_column(self) -> list[str]:
        recording = self.runs[0].recordings[0]
        for name, cells in recording.texts.items():
            values = list(dict.fromkeys(cells))
            changes = sum(a != b for a, b in pairwise(cells))
            if 1 < len(values) <= 500 and changes == len(values) - 1:
                text = f"column = {_toml(name)}  # {len(values)} values, one run each"
                return ["", "[runs]", text]
        return []

    def _wheel(self, drafts: dict[str, Draft]) -> list[str]:
        lines = ["", "[wheel]"]
        for key in ("radius", "diameter"):
            if key in self.stated:
                value, line = self.stated[key]
                number = value if " " in value else f"{value} m"
                return [*lines, f'{key} = "{number} +- 1 %"  # stated in the log: {line[:60]}']
        needed = "slip" not in self.found.roles() and "rim_speed" not in self.found.roles()
        inputs = inputs_of(drafts, self.runs[0])
        ratio = fastest_ratio(inputs) if inputs is not None and needed else math.nan
        hint = ""
        if math.isfinite(ratio) and ratio > 0.0:
            if 0.02 < ratio < 0.7:
                hint = f"; travel over rotation is {ratio:.3g} m at the lowest slip: a little less"
            else:
                hint = (
                    f"; travel over rotation is {ratio:.3g} m: a unit is wrong, or the rotation is "
                    "measured before a gearbox"
                )
        word = "NEEDED" if needed else "for checks"
        return [*lines, f'# radius = "0.15 m +- 1 %"  # {word}{hint}']

    def _load(self) -> list[str]:
        if "load" in self.found.roles():
            return []
        if "load" in self.stated and "mass" not in self.stated:
            value, line = self.stated["load"]
            return ["", "[load]", f'value = "{value} +- 1 %"  # stated in the log: {line[:60]}']
        in_name = number_in_names("load", self.run_names)
        if in_name is not None:
            pattern, unit, numbers = in_name
            shown = ", ".join(f"{n:g}" for n in numbers[:4])
            return [
                "",
                "[load]",
                f"file_name = {_toml(pattern)}  # the names say {shown}",
                f"unit = {_toml(unit)}",
            ]
        count = max(1, len(self.found.wheels))
        mass = self.stated.get("mass", ("", ""))[0]
        lines = ["", "# No column is a vertical load: it follows from the mass."]
        if mass:
            return [*lines, "[vehicle]", f'mass = "{mass} +- 1 %"', f"wheels = {count}"]
        return [
            *lines,
            "# [vehicle]                   # NEEDED, or [load] value = '60 N +- 1 N'",
            '# mass = "6.1 kg +- 0.1 kg"   # all that stands on the wheels',
            f"# wheels = {count}",
        ]

    def _channel(self, header: str, role: str, draft: Draft) -> list[str]:
        lines = ["", f"{header}  # {ROLES[role][1]}"]
        for key, value in draft.keys.items():
            comment = draft.comments.get(key, "")
            lines.append(f"{key} = {_toml(value)}" + (f"  # {comment}" if comment else ""))
        others = [c.address for c in self.found.others.get(role, [])[:4]]
        if others:
            lines.append(f"# or: {', '.join(others)}")
        if role in ("torque", "load", "drawbar_pull", "position", "ground_speed", "rim_speed"):
            share = {"torque": "2 %", "load": "1 %"}.get(role)
            if share:
                lines.append(f'bias = "{share}"  # calibration error that all rows share')
        return lines

    def _absent(self, role: str) -> list[str]:
        others: list[Candidate] = self.found.others.get(role, [])
        if role == "slip" and not ({"position", "ground_speed"} & self.found.roles()):
            in_name = number_in_names("slip", self.run_names)
            if in_name is not None:
                return [
                    "",
                    "[slip]",
                    f"file_name = {_toml(in_name[0])}",
                    f"unit = {_toml(in_name[1])}",
                ]
        if role == "ground_speed" and not ({"position", "slip"} & self.found.roles() or others):
            return [
                "",
                "# NEEDED: no column is the travel. One of these:",
                "# [ground_speed]",
                '# value = "0.02 m/s +- 1 %"   # a carriage of constant speed',
            ]
        if others:
            return ["", f"# [{role}]  # {ROLES[role][1]}", f"# column = {_toml(others[0].address)}"]
        return []


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int | np.number):
        return f"{float(value):g}" if float(value) != int(value) else f"{int(value)}"
    if isinstance(value, str) and "\\" in value and "'" not in value:
        return f"'{value}'"
    return json.dumps(value, ensure_ascii=False)
