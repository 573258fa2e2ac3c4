"""The text of a commented map for logs that nobody has described."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from soilml.io.cell_text import one_line
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
    why_time_unit,
)
from soilml.log_import.guesses.columns import (
    candidates_of,
    describe,
    describe_texts,
    liveliest,
    name_scores,
    words_of,
)
from soilml.log_import.guesses.constants import agreed_constants, stated_radius
from soilml.log_import.guesses.draft import (
    Draft,
    Marked,
    inputs_of,
    key_line,
    keys_alike,
)
from soilml.log_import.guesses.evidence import as_table, mark, weigh
from soilml.log_import.guesses.forces import by_behaviour
from soilml.log_import.guesses.missing_channels import absent_lines, load_lines
from soilml.log_import.guesses.roles import Assignment, assign, axle_of
from soilml.log_import.guesses.wheel_radius import wheel_lines
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import FileKind, LogMap
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor

_USUAL, _SHARE = 2.0, 0.15  # Shortest window for long runs, s, and its share of short ones
_MOST_LISTED, _LOOKED = 40, 8  # Most columns that are listed, and runs that are looked at
#: Words of columns of plate and shear tests.
_OF_PLATES = {"plate", "pressure", "penetration", "annulus", "shear", "platte", "druck"}


def _window_lines(runs: Sequence[Run]) -> list[str]:
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


@dataclass(frozen=True)
class DraftedMap:
    """A map as TOML with comments, and how many of its lines are marked as not known."""

    text: str
    marked: int
    evidence: str = ""  # What speaks for each guess, as lines of text


class MapDrafting:
    """The draft of a map of some logs, section by section."""

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
        self.time_why = why_time_unit(first, self.time_column, self.time_unit)
        self.restarts = restarts(logs[0], self.time_column) if not self.run_column else 0
        self.structs = structs_are_runs(logs[0], self.time_column)
        self.pauses, self.longest = pauses(logs[0], self.time_column, self.time_unit)
        if self.run_column or self.structs:
            self.pauses, self.longest = 0, math.inf
        for log in logs:
            refuse_a_table_of_runs(log)
        self.stated = agreed_constants(logs)
        self.rate = 0.0
        if not self.time_column and all(recording.clock is None for recording in first):
            self.rate = float(self.stated.common.get("rate", ("100", ""))[0].split()[0])
        self.kinds = self._with_clocks(guess_file_kinds(logs))
        self.runs = runs_of(logs, self._map(self.kinds))
        self.run = liveliest(self.runs[:_LOOKED])
        clocks = {self.time_column, *(kind.time_column for kind in self.kinds)}
        columns = candidates_of(self.run.recordings, self.steady > 0)
        self.columns = [c for c in columns if c.name not in clocks]
        self.errors = [c for c in self.columns if is_error(c)] if self.steady else []
        usable = [c for c in self.columns if c not in self.errors]
        behaved = by_behaviour(usable, self.run)
        self.reasons = behaved.reasons
        self.found: Assignment = assign(behaved.candidates)
        self.run_names = [run.name for run in self.runs]

    def _map(self, kinds: Sequence[FileKind]) -> LogMap:
        return LogMap(
            source="map",
            wheels=(),
            files=tuple(kinds),
            time_column=self.time_column,
            time_unit=self.time_unit,
            rate=self.rate,
            run_column=self.run_column,
            split_at_reset=self.restarts > 0 and not self.structs,
            each_struct=self.structs > 0,
            split_at_pause=self.longest,
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

    def draft(self, doubts: Mapping[str, str] | None = None) -> DraftedMap:
        """The whole map, with a mark on the channels that its own rows put in doubt, by role."""
        lines = self._head()
        lines += self._files() + self._time_lines() + self._run_lines()
        groups = self.found.wheels or {"": {}}
        drafts = {
            name: draft_channels(
                self.found.shared | own, self.run, self.stated.common, self.found.parts
            )
            for name, own in groups.items()
        }
        first = next(iter(drafts.values()))
        constants = self._constants()
        explained: list[str] = []
        for group in drafts.values():
            evidence = weigh(group, inputs_of(group, self.run), constants, self.found.others,
                             self.columns, self.reasons)  # fmt: skip
            for one in evidence:
                if not group[one.role].is_marked:  # one mark suffices
                    one.against = one.against or (doubts or {}).get(one.role, "")
            mark(group, evidence)
            explained.append(as_table(evidence))
        add_errors(first, self.found, self.errors)
        for role, why in self.reasons.items():
            known = role in first and isinstance(first[role].comments.get("column"), Marked)
            if role in first and not (known and not isinstance(why, Marked)):
                first[role].comments["column"] = why
        lines += wheel_lines(first, self.found, self.run, self.stated.common, self.run_names)
        lines += load_lines(self.found, self.stated, self.run_names, len(self.labels))
        for role in ROLES:
            if role in self.found.shared:
                lines += self._channel(f"[{role}]", role, first[role])
            elif role not in self.found.roles():
                lines += absent_lines(role, self.found, self.columns, self.stated, self.run_names)
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
            lines += _window_lines(self.runs)
        # values are plain already; names and lines of the log also stand in comments
        text = "\n".join(one_line(line) for line in lines) + "\n"
        names = [f"wheel {name}\n" if name else "" for name in drafts]
        why = "".join(name + own for name, own in zip(names, explained, strict=True))
        return DraftedMap(text, sum(isinstance(line, Marked) for line in lines), why)

    def _constants(self) -> dict[str, float]:
        """Radius (m) and weight on each wheel (N), as far as the logs state them."""
        stated, found = self.stated.common, {}
        if radius := stated_radius(stated):
            found["radius"] = radius
        if "mass" in stated:
            count = int(stated.get("wheels", (str(max(1, len(self.found.wheels))), ""))[0])
            mass, _, unit = stated["mass"][0].partition(" ")
            found["weight"] = 9.80665 * float(mass) * factor(unit or "kg", "kg", "mass") / count
        return found

    def _head(self) -> list[str]:
        names = run_names([log[0].file for log in self.logs])
        shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        lines = [
            f"# Map of {len(names)} log{'s' if len(names) > 1 else ''}: {shown}",
            "# Written by `soilml import --init`. All of it is a guess: look at the lines with",
            "# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:",
            '# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.',
            "#",
            "# The columns, with the unit that the log states and where 98 % of their values lie:",
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
            lines += ["", f"[files.{kind.name}]", key_line("pattern", kind.pattern)]
            why = "their clocks share no time: each starts at 0" if kind.clock == "start" else (
                "times can be compared; 'start' where each clock starts at 0"
            )  # fmt: skip
            lines.append(key_line("clock", kind.clock, why))
            if kind.time_column:
                lines.append(key_line("time", kind.time_column))
                lines.append(key_line("time_unit", kind.time_unit))
        return lines

    def _time_lines(self) -> list[str]:
        if self.steady:
            return []
        if self.time_column:
            named = "time" in name_scores(self.time_column)
            why: str = "" if named else Marked("CHANGE: its name is of no time; it rises evenly")
            column = key_line("column", self.time_column, why)
            return ["", "[time]", column, key_line("unit", self.time_unit, self.time_why)]
        if not self.rate:
            return ["", "# Time comes from the messages."]
        why = "stated in the log"
        if "rate" not in self.stated.common:
            why = Marked("CHANGE: no column is a clock")
        return ["", "[time]", key_line("rate", f"{self.rate:g} Hz", why)]

    def _run_lines(self) -> list[str]:
        if self.steady:
            why = f"{self.steady} rows and no time: each is a run"
            lines = ["", "[runs]", key_line("each_row", True, why)]
            if name := run_of_rows(self.run.recordings):
                why = "rows with one name were driven on one soil"
                lines.append(key_line("column", name, why))
            return lines
        key, why = "", ""
        value: str | bool = True
        if self.run_column:
            key, value, why = "column", self.run_column, f"{self.run_count} values, one run each"
            if self.labels:
                why = f"a line for each wheel ({', '.join(self.labels[:4])}): each is a run"
        elif self.structs:
            key, why = "each_struct", f"{self.structs} with the same columns"
        elif self.restarts:
            key = "split_where_time_restarts"
            why = f"the time starts again {self.restarts} times"
        elif self.pauses:
            key, value = "split_at_pauses_over", f"{self.longest:g} s"
            why = f"the log pauses {self.pauses} times"
        return ["", "[runs]", key_line(key, value, why)] if key else []

    def _table(self, header: str, role: str, draft: Draft) -> list[str]:
        lines = ["", header]
        for key, value in draft.keys.items():
            lines.append(key_line(key, value, draft.comments.get(key, "")))
        others = [c.address for c in self.found.others.get(role, [])[:4]]
        if others and "column" in draft.keys:
            lines.append(f"# or: {', '.join(others)}")
        return lines

    def _channel(self, header: str, role: str, draft: Draft, more: str = "") -> list[str]:
        lines = self._table(f"{header}  # {ROLES[role][1]}{more}", role, draft)
        if share := {"torque": "2 %", "load": "1 %"}.get(role):
            lines.append(key_line("bias", share, "calibration error that all rows share"))
        return lines
