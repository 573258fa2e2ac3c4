"""A guess of the map of logs that nobody has described: `soilml import --init`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

from soilml.io.toml_text import toml_key
from soilml.log_import.channels.runs import matched_files, run_names, runs_of
from soilml.log_import.guesses.absent_channels import AbsentChannels
from soilml.log_import.guesses.channel_drafts import add_errors, draft_channels, is_error
from soilml.log_import.guesses.clocks_and_runs import (
    guess_clock,
    guess_file_kinds,
    guess_run_column,
    guess_wheel_column,
    lines_of_first,
    refuse_a_table_of_runs,
    restarts_and_pauses,
    rows_are_runs,
    run_of_rows,
    structs_are_runs,
)
from soilml.log_import.guesses.columns import (
    candidates_of,
    describe,
    is_size,
    liveliest,
    name_scores,
    says,
)
from soilml.log_import.guesses.constants import agreed_constants, gears_in_names, stated_radius
from soilml.log_import.guesses.draft import (
    Draft,
    driving_means,
    implied_radius,
    inputs_of,
    radius_of_slip,
)
from soilml.log_import.guesses.evidence import weigh
from soilml.log_import.guesses.forces import by_behaviour
from soilml.log_import.guesses.roles import assign, axle_of
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import FileKind, LogMap, RunsMap, TimeMap
from soilml.log_import.mapping.written_map import Marked, WrittenMap, WrittenTable
from soilml.log_import.readers import Progress, read_logs, silent
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor

_USUAL, _SHARE = 2.0, 0.15  # Shortest window for long runs, s, and its share of short ones
_MOST_WHEELS = 8  # Wheels that may share a mass, where nothing says how many do
_MOST_LISTED, _LOOKED = 40, 8  # Most columns that are listed, and runs that are looked at
#: Words of columns of plate and shear tests.
_OF_PLATES = {"plate", "pressure", "penetration", "annulus", "shear", "platte", "druck"}
#: Calibration errors that all rows share, where nothing states one.
_BIASES = {"torque": "2 %", "load": "1 %"}
#: Radii of wheels, m; largest scatter over the radius of a slip that was computed from both speeds.
_PLAUSIBLE, _COMPUTED = (0.02, 0.7), 0.002


class MapGuess:
    """What the logs look like, and the map that follows."""

    def __init__(self, logs: Sequence[Sequence[Recording]]) -> None:
        self.logs = logs
        for log in logs:
            refuse_a_table_of_runs(log)
        self.stated = agreed_constants(logs)
        self.steady = rows_are_runs(logs)
        self.labels: list[str] = []  # Of wheels that take turns in the lines of a log
        self.time, self.time_why = TimeMap(rate=100.0), ""
        self.runs_map, self.runs_table = RunsMap(), WrittenTable("runs")
        self._divide([recording for log in logs[:4] for recording in log])
        self.kinds = self._with_clocks(guess_file_kinds(logs))
        self.runs = runs_of(logs, self._map(self.kinds))
        self.run_names = [run.name for run in self.runs]
        self.run = liveliest(self.runs[:_LOOKED])
        clocks = {self.time.column, *(kind.time_column for kind in self.kinds)}
        columns = candidates_of(self.run.recordings, self.steady > 0)
        self.columns = [c for c in columns if c.name not in clocks]
        self.errors = [c for c in self.columns if is_error(c)] if self.steady else []
        sizes = [c for c in self.columns if is_size(c.name) and c.kind in (None, "m")]
        self.usable = [c for c in self.columns if c not in self.errors and c not in sizes]
        candidates, self.reasons = by_behaviour(self.usable, self.run)
        self.found = assign(candidates)
        self.evidence = ""

    def _map(self, kinds: Sequence[FileKind]) -> LogMap:
        return LogMap("map", files=tuple(kinds), time=self.time, runs=self.runs_map)

    def _divide(self, first: Sequence[Recording]) -> None:
        """The clock, and what divides a file into runs."""
        log, put = self.logs[0], self.runs_table.put
        if self.steady:
            put("each_row", True, f"{self.steady} rows and no time: each is a run")
            if name := run_of_rows(log):
                put("column", name, "rows with one name were driven on one soil")
            return
        column, count = guess_run_column(log)
        why = f"{count} values, one run each"
        if not column:
            column, self.labels = guess_wheel_column(log)
            why = f"a line for each wheel ({', '.join(self.labels[:4])}): each is a run"
        clock, unit, self.time_why = guess_clock(
            lines_of_first(first, column) if self.labels else first
        )
        if clock or any(recording.clock is not None for recording in first):
            self.time = TimeMap(clock, unit)
        elif "rate" in self.stated.common:
            self.time = TimeMap(rate=float(self.stated.common["rate"][0].split()[0]))
        if column:
            self.runs_map = RunsMap(column)
            put("column", column, why)
            return
        structs = structs_are_runs(log, clock)
        again, count, pause = restarts_and_pauses(log, clock, self.time.unit)
        if structs:
            self.runs_map = RunsMap(each_struct=True)
            put("each_struct", True, f"{structs} with the same columns")
            return
        self.runs_map = RunsMap(at_reset=again > 0, at_pause=pause)
        if again:
            put("split_where_time_restarts", True, f"the time starts again {again} times")
        elif count:
            put("split_at_pauses_over", f"{pause:g} s", f"the log pauses {count} times")

    def _with_clocks(self, kinds: Sequence[FileKind]) -> tuple[FileKind, ...]:
        """Kinds with their own columns of time, and with clocks that overlap."""
        if not kinds:
            return ()
        members = next(iter(matched_files(self.logs, kinds).values()))
        named = []
        for kind in kinds:
            column, unit, _ = guess_clock([own for own, other in members if other is kind])
            alike = (column, unit) == (self.time.column, self.time.unit)
            named.append(kind if alike else replace(kind, time_column=column, time_unit=unit))
        times = runs_of(self.logs, self._map(named))[0].times
        if max(own[0] for own in times) >= min(own[-1] for own in times):
            return tuple(replace(kind, clock="start") for kind in named)
        return tuple(named)

    def map(self) -> WrittenMap:
        """The whole map, with a mark on the channels that lack evidence."""
        stated, shared, wheels = self.stated.common, self.found.shared, self.found.wheels
        radius, weight, explained = stated_radius(stated), self._weight(), []
        drafts: dict[str, dict[str, Draft]] = {}
        for name, own in (wheels or {"": {}}).items():
            steady = self.steady > 0
            group = draft_channels(shared | own, self.run, steady, stated, self.found.parts)
            evidence = weigh(group, inputs_of(group, self.run, steady), radius, weight,
                             self.found.others, self.usable, self.reasons, not steady)  # fmt: skip
            explained += [f"wheel {name}\n" if name else "", *map(str, evidence)]
            for role, draft in group.items():
                if others := [c.address for c in self.found.others.get(role, [])[:4]]:
                    draft.after = [f"# or: {', '.join(others)}"]
                if role in _BIASES:
                    draft.put("bias", _BIASES[role], "calibration error that all rows share")
            drafts[name] = group
        self.evidence = "".join(explained)
        first = next(iter(drafts.values()))
        add_errors(first, self.found, self.errors)
        for role, why in self.reasons.items():
            known = role in first and isinstance(first[role].comments.get("column"), Marked)
            if role in first and not (known and not isinstance(why, Marked)):
                first[role].comments["column"] = why
        absent = AbsentChannels(self.found, self.usable, self.stated, self.run_names)
        tables = [*self._files(), *self._time_tables(), *self._wheel_tables(first)]
        if "load" not in self.found.roles():
            tables.append(absent.load(len(self.labels)))
        for role, (_, what) in ROLES.items():
            if role in shared:
                tables.append(replace(first[role], path=role, about=what))
            elif role not in self.found.roles():
                tables += absent.table(role)
        alike: dict[str, list[str]] = {}
        for role in next(iter(wheels.values()), {}):
            groups = [own[role].keys for own in drafts.values()]
            keys = [k for k, v in groups[0].items() if all(d.get(k) == v for d in groups)]
            about = f"{ROLES[role][1]}; each wheel has a column of its own"
            alike[role] = keys
            tables.append(replace(first[role].only(role, keys), about=about, after=[]))
        for name, own in wheels.items():
            axle = axle_of(name)
            tables.append(WrittenTable(f"wheels.{name}", {"axle": axle} if axle else {}))
            for role in own:
                draft = drafts[name][role]
                left = [key for key in draft.keys if key not in alike[role]]
                tables.append(draft.only(f"wheels.{name}.{role}", left))
        return WrittenMap(self._head(), [*tables, *(() if self.steady else self._window_tables())])

    def _weight(self) -> tuple[float, float] | None:
        """Least and largest weight on each wheel by the stated mass, N; None without one."""
        stated = self.stated.common
        if "mass" not in stated:
            return None
        count = int(stated.get("wheels", (str(max(1, len(self.found.wheels))), ""))[0])
        mass, _, unit = stated["mass"][0].partition(" ")
        weight = 9.80665 * float(mass) * factor(unit or "kg", "kg", "mass") / count
        known = "wheels" in stated or len(self.found.wheels) > 1
        return weight / (1 if known else _MOST_WHEELS), weight

    def _head(self) -> list[str]:
        names = run_names([log[0].file for log in self.logs])
        shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        listed = self.columns
        if len(listed) > _MOST_LISTED:
            listed = [c for c in listed if not c.about.constant][:_MOST_LISTED]
        lines = [
            f"# Map of {len(names)} log{'s' if len(names) > 1 else ''}: {shown}",
            "# Written by `soilml import --init`. All of it is a guess: look at the lines with",
            "# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:",
            '# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.',
            "#",
            "# The columns, with the unit that the log states and where 98 % of their values lie:",
            *(f"#   {line}" for line in describe(listed, self.run.recordings)),
        ]
        if len(self.columns) > len(listed):
            lines.append(f"#   and {len(self.columns) - len(listed)} more")
        of_plates = any(says(c.address, _OF_PLATES) for c in self.columns)
        if of_plates and not self.found.roles() & {"wheel_speed", "wheel_angle", "slip"}:
            lines.append("# Plate or shear tests, it seems: `soilml bevameter` takes those.")
        notes = dict.fromkeys(note for log in self.logs for r in log for note in r.notes)
        return lines + [f"# Note: {note}" for note in list(notes)[:5]]

    def _files(self) -> list[WrittenTable]:
        tables = []
        for kind in self.kinds:
            table = WrittenTable(f"files.{kind.name}", {"pattern": kind.pattern})
            why = "their clocks share no time: each starts at 0" if kind.clock == "start" else (
                "times can be compared; 'start' where each clock starts at 0"
            )  # fmt: skip
            table.put("clock", kind.clock, why)
            if kind.time_column:
                table.keys |= {"time": kind.time_column, "time_unit": kind.time_unit}
            tables.append(table)
        return tables

    def _time_tables(self) -> list[WrittenTable]:
        """Clock, and what divides the logs into runs."""
        time, why = WrittenTable("time"), ""
        if self.time.column:
            if "time" not in name_scores(self.time.column):
                why = Marked("CHANGE: its name is of no time; it rises evenly")
            time.put("column", self.time.column, why)
            time.put("unit", self.time.unit, self.time_why)
        elif self.time.rate and not self.steady:
            known = "rate" in self.stated.common
            why = "stated in the log" if known else Marked("CHANGE: no column is a clock")
            time.put("rate", f"{self.time.rate:g} Hz", why)
        elif not self.steady:
            time = WrittenTable(before=["# Time comes from the messages."])
        return [table for table in (time, self.runs_table) if table.keys or table.before]

    def _wheel_tables(self, drafts: dict[str, Draft]) -> list[WrittenTable]:
        """[wheel]: the radius that the logs state, or that a logged slip implies; and [gears]."""
        wheel, stated = WrittenTable("wheel"), self.stated.common
        if several := gears_in_names(self.run_names):
            pattern, gears = several
            why = f"the names say {', '.join(list(gears)[:4])}; [gears.NAME] of the model file"
            wheel.put("gear_from", pattern, why)
            tables = [wheel]
            for name, (key, value) in gears.items():
                table = WrittenTable(f"gears.{toml_key(name)}")
                table.put(key, f"{value} +- 1 %", "by the names")
                tables.append(table)
            return tables
        key = next((key for key in ("radius", "diameter") if key in stated), "")
        if key:
            value, line = stated[key]
            asked = Marked(f"stated in the {line}") if "CHANGE" in line else ""
            value = value if " " in value else f"{value} m"
            wheel.put(key, f"{value} +- 1 %", asked or f"stated in the log: {line[:60]}")
        else:
            self._put_implied_radius(wheel, drafts)
        return [wheel]

    def _put_implied_radius(self, wheel: WrittenTable, drafts: dict[str, Draft]) -> None:
        """The radius by a logged slip; else a line that asks for it where it is needed."""
        roles = self.found.roles()
        turning = {"wheel_speed", "wheel_angle"} & roles
        needed = bool(turning) and not {"slip", "rim_speed"} & roles
        inputs = inputs_of(drafts, self.run, self.steady > 0) if turning else None
        # where rotation is of the motor
        gear = math.prod(float(drafts[role].keys.get("gear_ratio", 1.0)) for role in turning)
        slips = [*self.found.others.get("slip", [])]
        slips += [self.found.shared["slip"]] if "slip" in self.found.shared else []
        if inputs is not None and slips:
            radius, scatter = radius_of_slip(inputs, slips[0], self.run)
            if _PLAUSIBLE[0] < gear * radius < _PLAUSIBLE[1]:
                why = f"v / (omega (1 - slip)) with the slip of the column {slips[0].address!r}"
                if scatter > _COMPUTED:
                    why = Marked(f"CHANGE: {why}, which was perhaps set and not measured")
                wheel.put("radius", f"{gear * radius:.3g} m +- 1 %", why)
                return
        ratio = math.nan
        if inputs is not None and needed:
            ratio = implied_radius(drafts, driving_means(inputs, 2.0))
        hint = ""
        if ratio > 0.0:
            hint = f"; travel over rotation is {ratio:.3g} m"
            if _PLAUSIBLE[0] < ratio < _PLAUSIBLE[1]:
                hint += " at the lowest slip: a little less"
            else:
                hint += ": a unit is wrong, or the rotation is measured before a gearbox"
        line = f'# radius = "0.15 m +- 1 %"  # {"NEEDED" if needed else "for checks"}{hint}'
        wheel.after.append(Marked(line) if needed else line)

    def _window_tables(self) -> list[WrittenTable]:
        """[windows], with shorter windows for short runs, and an example of [[leave_out]]."""
        lengths = sorted(times[-1] - times[0] for run in self.runs for times in run.times)
        middle = lengths[len(lengths) // 2] if lengths else 0.0
        shortest = min(_USUAL, float(f"{max(_SHARE * middle, 0.05):.1g}"))
        table = WrittenTable("windows", about="steady windows: each becomes a row")
        table.put("shortest", f"{shortest:g} s")
        table.put("settle", f"{min(0.5, shortest / 4.0):g} s", "left out after each change")
        table.put("sensitivity", 1, "2 finds smaller changes, 0.5 only larger ones")
        table.after = ["# within = [5, 60]  # s after the start: only this part of each run"]
        example = [
            "# [[leave_out]]  # a stretch that somebody disturbed",
            f'# run = "{self.runs[0].name}"',
            "# from = 12.0  # s",
            '# why = "the carriage was pulled"',
        ]
        return [table, WrittenTable(before=example)]


@dataclass(frozen=True)
class DraftedMap:
    """A map as TOML with comments, how many of its lines are marked, and the evidence as text."""

    text: str
    marked: int
    evidence: str


def init_map(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> str:
    """Look at logs and write a map with guesses, each with its reason, as TOML with comments.

    Guesses come from names, units and the behaviour of the values; checks of seconds of driving
    mark what they doubt. What no log shows, such as the radius, is marked with CHANGE or NEEDED.

    Raises `InputError` where a file cannot be read or has no columns.
    """
    return draft_map(logs).text


def draft_map(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], progress: Progress = silent
) -> DraftedMap:
    """What `init_map` gives, with the number of lines that are marked."""
    recordings = read_logs(log_files(logs), progress)
    guess = MapGuess(recordings)
    found = guess.map()
    return DraftedMap(found.text, found.marked, guess.evidence)
