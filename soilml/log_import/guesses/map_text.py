"""A commented map for logs that nobody has described: `soilml import --init`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from soilml.errors import InputError
from soilml.io.cell_text import escaped
from soilml.log_import.channels.runs import Run, matched_files, run_names, runs_of
from soilml.log_import.guesses.channel_drafts import add_errors, draft_channels, is_error
from soilml.log_import.guesses.clocks_and_runs import (
    clocks_differ,
    guess_clock,
    guess_file_kinds,
    guess_run_column,
    guess_wheel_column,
    lines_of_first,
    pauses,
    refuse_a_table_of_runs,
    restarts,
    rows_are_runs,
    run_of_rows,
    structs_are_runs,
)
from soilml.log_import.guesses.columns import (
    candidates_of,
    describe,
    describe_texts,
    liveliest,
    words_of,
)
from soilml.log_import.guesses.constants import agreed_constants
from soilml.log_import.guesses.draft import Draft, fastest_ratio, inputs_of, keys_alike, toml_value
from soilml.log_import.guesses.missing_channels import absent_lines, load_lines
from soilml.log_import.guesses.roles import Assignment, assign, axle_of
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import FileKind, LogMap
from soilml.log_import.readers import read_log
from soilml.log_import.recording import Recording

#: Shortest window for long runs, s, and its share of short ones.
_USUAL, _SHARE = 2.0, 0.15
#: Most columns that are listed, and runs that are looked at.
_MOST_LISTED, _LOOKED = 40, 8
#: Words of columns of plate and shear tests.
_OF_PLATES = {"plate", "pressure", "penetration", "annulus", "shear", "platte", "druck"}


def guess_windows(runs: Sequence[Run], drafts: dict[str, Draft]) -> list[str]:
    """Lines of the table; short runs get shorter windows."""
    lengths = sorted(times[-1] - times[0] for run in runs for times in run.times)
    middle = lengths[len(lengths) // 2] if lengths else 0.0
    shortest = min(_USUAL, float(f"{max(_SHARE * middle, 0.05):.1g}"))
    settle = min(0.5, shortest / 4.0)
    return [
        "",
        "[windows]  # steady windows: each becomes a row",
        f'shortest = "{shortest:g} s"',
        f'settle = "{settle:g} s"  # left out after each change',
        "sensitivity = 1  # 2 finds smaller changes, 0.5 only larger ones",
        "# within = [5, 60]  # s after the start: only this part of each run",
        "",
        "# [[leave_out]]  # a stretch that somebody disturbed",
        f'# run = "{runs[0].name}"',
        "# from = 12.0  # s",
        '# why = "the carriage was pulled"',
    ]


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
        first = [recording for log in logs[:4] for recording in log]
        self.steady = rows_are_runs(logs)
        self.run_column, self.run_count = ("", 0) if self.steady else guess_run_column(logs[0])
        self.labels: list[str] = []
        if not self.steady and not self.run_column:
            self.run_column, self.labels = guess_wheel_column(logs[0])
            self.run_count = len(self.labels)
            first = lines_of_first(first, self.run_column) if self.labels else first
        self.time_column, self.time_unit = ("", "") if self.steady else guess_clock(first)
        self.restarts = restarts(logs[0], self.time_column) if not self.run_column else 0
        self.structs = structs_are_runs(logs[0], self.time_column)
        self.pauses, self.longest = pauses(logs[0], self.time_column, self.time_unit)
        if self.run_column or self.structs:
            self.pauses, self.longest = 0, math.inf
        for log in logs:
            refuse_a_table_of_runs(log)
        self.stated, self.heads = agreed_constants(logs)
        self.rate = 0.0
        if not self.time_column and all(recording.clock is None for recording in first):
            self.rate = float(self.stated.get("rate", ("100", ""))[0].split()[0])
        self.kinds = self._with_clocks(guess_file_kinds(logs))
        self.runs = runs_of(logs, self._map(self.kinds))
        self.run = liveliest(self.runs[:_LOOKED])
        clocks = {self.time_column, *(kind.time_column for kind in self.kinds)}
        columns = candidates_of(self.run.recordings, self.steady > 0)
        self.columns = [c for c in columns if c.name not in clocks]
        self.errors = [c for c in self.columns if is_error(c)] if self.steady else []
        self.found: Assignment = assign([c for c in self.columns if c not in self.errors])
        self.run_names = [run.name for run in self.runs]

    def _map(self, kinds: Sequence[FileKind]) -> LogMap:
        return LogMap(
            "map",
            (),
            tuple(kinds),
            self.time_column,
            self.time_unit,
            self.rate,
            self.run_column,
            self.restarts > 0 and not self.structs,
            self.structs > 0,
            self.longest,
        )

    def _with_clocks(self, kinds: Sequence[FileKind]) -> tuple[FileKind, ...]:
        """Kinds with their own columns of time, and with clocks that overlap."""
        if not kinds:
            return ()
        members = next(iter(matched_files(self.logs, kinds).values()))
        named = []
        for kind in kinds:
            own = [recording for recording, other in members if other is kind]
            column, unit = guess_clock(own)
            alike = (column, unit) == (self.time_column, self.time_unit)
            named.append(kind if alike else replace(kind, time_column=column, time_unit=unit))
        run = runs_of(self.logs, self._map(named))[0]
        if clocks_differ([(times[0], times[-1]) for times in run.times]):
            return tuple(replace(kind, clock="start") for kind in named)
        return tuple(named)

    def text(self) -> str:
        """The whole map."""
        lines = self._head()
        lines += self._files() + self._time_lines() + self._run_lines()
        groups = self.found.wheels or {"": {}}
        drafts = {
            name: draft_channels(self.found.shared | own, self.run, self.stated, self.found.parts)
            for name, own in groups.items()
        }
        first = next(iter(drafts.values()))
        add_errors(first, self.found, self.errors)
        lines += self._wheel(first)
        lines += load_lines(self.found, self.stated, self.heads, self.run_names, len(self.labels))
        for role in ROLES:
            if role in self.found.shared:
                lines += self._channel(f"[{role}]", role, first[role])
            elif role not in self.found.roles():
                lines += absent_lines(
                    role, self.found, self.columns, self.run_names, self.stated, self.heads
                )
        of_wheels = self.found.wheels.items()
        alike = keys_alike([{role: drafts[name][role] for role in own} for name, own in of_wheels])
        for role, draft in alike.items():
            lines += self._channel(f"[{role}]", role, draft, "; each wheel has a column of its own")
        for name, own in self.found.wheels.items():
            lines += ["", f"[wheels.{name}]"]
            if axle := axle_of(name):
                lines.append(f'axle = "{axle}"')
            for role in own:
                draft = drafts[name][role].without(alike[role])
                lines += self._table(f"[wheels.{name}.{role}]", role, draft)
        if not self.steady:
            lines += guess_windows(self.runs, first)
        # values are plain already; names and lines of the log also stand in comments
        return "\n".join(escaped(line).replace("\n", "\\n") for line in lines) + "\n"

    def _head(self) -> list[str]:
        names = run_names([log[0].file for log in self.logs])
        shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        lines = [
            f"# Map of {len(names)} log{'s' if len(names) > 1 else ''}: {shown}",
            "# Written by `soilml import --init`. All of it is a guess: look at the lines with",
            "# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:",
            '# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.',
            "#",
            "# The columns, with the unit that the log states and the range of their values:",
        ]
        listed = self.columns
        if len(listed) > _MOST_LISTED:
            listed = [c for c in listed if not c.about.constant]
        lines += [f"#   {line}" for line in describe(listed[:_MOST_LISTED])]
        words = {word for c in self.columns for word in words_of(c.address)}
        if words & _OF_PLATES and not self.found.roles() & {"wheel_speed", "wheel_angle", "slip"}:
            lines.append("# Plate or shear tests, it seems: `soilml bevameter` takes those.")
        if len(self.columns) > len(listed[:_MOST_LISTED]):
            lines.append(f"#   and {len(self.columns) - len(listed[:_MOST_LISTED])} more")
        lines += [f"#   {line}" for line in describe_texts(self.run.recordings)]
        notes = dict.fromkeys(note for log in self.logs for r in log for note in r.notes)
        return lines + [f"# Note: {note}" for note in list(notes)[:5]]

    def _files(self) -> list[str]:
        lines = []
        for kind in self.kinds:
            lines += ["", f"[files.{kind.name}]", f"pattern = {toml_value(kind.pattern)}"]
            why = "their clocks share no time: each starts at 0" if kind.clock == "start" else (
                "times can be compared; 'start' where each clock starts at 0"
            )  # fmt: skip
            lines.append(f'clock = "{kind.clock}"  # {why}')
            if kind.time_column:
                lines.append(f"time = {toml_value(kind.time_column)}")
                lines.append(f"time_unit = {toml_value(kind.time_unit)}")
        return lines

    def _time_lines(self) -> list[str]:
        if self.steady:
            return []
        if self.time_column:
            column, unit = toml_value(self.time_column), toml_value(self.time_unit)
            return ["", "[time]", f"column = {column}", f"unit = {unit}"]
        if not self.rate:
            return ["", "# Time comes from the messages."]
        stated = "stated in the log" if "rate" in self.stated else "CHANGE: no column is a clock"
        return ["", "[time]", f'rate = "{self.rate:g} Hz"  # {stated}']

    def _run_lines(self) -> list[str]:
        if self.steady:
            lines = [
                "",
                "[runs]",
                f"each_row = true  # {self.steady} rows and no time: each is a run",
            ]
            name = run_of_rows(self.run.recordings)
            why = "rows with one name were driven on one soil"
            return [*lines, f"column = {toml_value(name)}  # {why}"] if name else lines
        if self.run_column:
            column = toml_value(self.run_column)
            what = f"{self.run_count} values, one run each"
            if self.labels:
                what = f"a line for each wheel ({', '.join(self.labels[:4])}): each is a run"
            return ["", "[runs]", f"column = {column}  # {what}"]
        if self.structs:
            return ["", "[runs]", f"each_struct = true  # {self.structs} with the same columns"]
        if self.restarts:
            why = f"the time starts again {self.restarts} times"
            return ["", "[runs]", f"split_where_time_restarts = true  # {why}"]
        if self.pauses:
            why = f"the log pauses {self.pauses} times"
            return ["", "[runs]", f'split_at_pauses_over = "{self.longest:g} s"  # {why}']
        return []

    def _wheel(self, drafts: dict[str, Draft]) -> list[str]:
        lines = ["", "[wheel]"]
        for key in ("radius", "diameter"):
            if key in self.stated:
                value, line = self.stated[key]
                number = value if " " in value else f"{value} m"
                return [*lines, f'{key} = "{number} +- 1 %"  # stated in the log: {line[:60]}']
        needed = not {"slip", "rim_speed"} & self.found.roles() and bool(
            {"wheel_speed", "wheel_angle"} & self.found.roles()
        )
        inputs = inputs_of(drafts, self.run)
        ratio = fastest_ratio(inputs) if inputs is not None and needed else math.nan
        hint = ""
        for role in ("wheel_speed", "wheel_angle"):
            if role in drafts:  # the rotation is that of the motor
                ratio *= float(drafts[role].keys.get("gear_ratio", 1.0))
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

    def _table(self, header: str, role: str, draft: Draft) -> list[str]:
        lines = ["", header]
        for key, value in draft.keys.items():
            comment = draft.comments.get(key, "")
            lines.append(f"{key} = {toml_value(value)}" + (f"  # {comment}" if comment else ""))
        others = [c.address for c in self.found.others.get(role, [])[:4]]
        if others and "column" in draft.keys:
            lines.append(f"# or: {', '.join(others)}")
        return lines

    def _channel(self, header: str, role: str, draft: Draft, more: str = "") -> list[str]:
        lines = self._table(f"{header}  # {ROLES[role][1]}{more}", role, draft)
        if role in ("torque", "load", "drawbar_pull", "position", "ground_speed", "rim_speed"):
            share = {"torque": "2 %", "load": "1 %"}.get(role)
            if share:
                lines.append(f'bias = "{share}"  # calibration error that all rows share')
        return lines
