"""A guess of the map of logs that nobody has described: `soilml import --init`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from soilml.io.toml_text import toml_key
from soilml.log_import.channels.runs import run_names, runs_of
from soilml.log_import.guesses.absent_channels import AbsentChannels
from soilml.log_import.guesses.assignment import assign, axle_of
from soilml.log_import.guesses.channel_drafts import add_errors, draft_channels, is_error
from soilml.log_import.guesses.clocks_and_runs import Division, divide, refuse_a_table_of_runs
from soilml.log_import.guesses.columns import candidates_of, describe, liveliest
from soilml.log_import.guesses.constants import agreed_constants, gears_in_names, stated_radius
from soilml.log_import.guesses.draft import Draft, driving_means, implied_radius, inputs_of
from soilml.log_import.guesses.evidence import Judge
from soilml.log_import.guesses.forces import by_behaviour
from soilml.log_import.guesses.role_words import USUAL, is_size, says
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import LogMap
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
_PLAUSIBLE = (0.02, 0.7)  # Radii of wheels, m
_HEAD = """\
# Written by `soilml import --init`. All of it is a guess: look at the lines with
# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:
# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.
#
# The columns, with the unit that the log states and where 98 % of their values lie:"""


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
    for log in recordings:
        refuse_a_table_of_runs(log)
    found, evidence = _Guess(recordings).map()
    return DraftedMap(found.text, found.marked, evidence)


class _Guess:
    """What the logs look like, and the map that follows."""

    def __init__(self, logs: Sequence[Sequence[Recording]]) -> None:
        self.logs = logs
        self.stated = agreed_constants(logs)
        self.division: Division = divide(logs, self.stated.common)
        self.steady = self.division.runs.each_row
        found = LogMap(
            "map", files=self.division.kinds, time=self.division.time, runs=self.division.runs
        )
        self.runs = runs_of(logs, replace(found, runs=replace(found.runs, each_row=False)))
        self.run_names = [run.name for run in self.runs]
        self.run = liveliest(self.runs[:_LOOKED])
        clocks = {found.time.column, *(kind.time_column for kind in found.files)}
        columns = candidates_of(self.run.recordings, self.steady)
        self.columns = [c for c in columns if c.name not in clocks]
        self.errors = [c for c in self.columns if is_error(c)] if self.steady else []
        sizes = [c for c in self.columns if is_size(c.name) and c.kind in (None, "m")]
        self.usable = [c for c in self.columns if c not in self.errors and c not in sizes]
        candidates, self.reasons = by_behaviour(self.usable, self.run)
        self.found = assign(candidates)

    def map(self) -> tuple[WrittenMap, str]:
        """The whole map, with a mark on the channels that lack evidence; and the evidence."""
        shared, wheels = self.found.shared, self.found.wheels
        drafts, evidence = self._drafts()
        first = next(iter(drafts.values()))
        absent = AbsentChannels(self.found, self.usable, self.stated, self.run_names)
        tables = [*self.division.tables, *self._wheel_tables(first)]
        if "load" not in self.found.roles():
            tables.append(absent.load(len(self.division.labels)))
        for role, (_, what) in ROLES.items():
            if role in shared:
                tables.append(replace(first[role], path=role, about=what))
            elif role not in self.found.roles() and role != "load":
                tables += filter(None, [absent.table(role)])
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
        tables += [] if self.steady else self._window_tables()
        return WrittenMap(self._head(), tables), evidence

    def _drafts(self) -> tuple[dict[str, dict[str, Draft]], str]:
        """The channels of each wheel, of "" where there is one, and the evidence for them."""
        stated, found = self.stated.common, self.found
        judge = Judge(stated_radius(stated), self._weight(), found.others, self.usable,
                      self.reasons, not self.steady)  # fmt: skip
        explained = []
        drafts: dict[str, dict[str, Draft]] = {}
        for name, own in (found.wheels or {"": {}}).items():
            group = draft_channels(found.shared | own, self.run, self.steady, stated, found.parts)
            evidence = judge.weigh(group, inputs_of(group, self.run, self.steady))
            explained += [f"wheel {name}\n" if name else "", *map(str, evidence)]
            for role, draft in group.items():
                if others := [c.address for c in found.others.get(role, [])[:4]]:
                    draft.after = [f"# or: {', '.join(others)}"]
                if bias := USUAL[role].bias:
                    draft.put("bias", bias, "calibration error that all rows share")
            drafts[name] = group
        first = next(iter(drafts.values()))
        add_errors(first, found, self.errors)
        for role, why in self.reasons.items():
            known = role in first and isinstance(first[role].comments.get("column"), Marked)
            if role in first and not (known and not isinstance(why, Marked)):
                first[role].comments["column"] = why
        return drafts, "".join(explained)

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
            listed = [c for c in listed if not c.constant][:_MOST_LISTED]
        lines = [f"# Map of {len(names)} log{'s' if len(names) > 1 else ''}: {shown}"]
        lines += _HEAD.splitlines()
        lines += [f"#   {line}" for line in describe(listed, self.run.recordings)]
        if len(self.columns) > len(listed):
            lines.append(f"#   and {len(self.columns) - len(listed)} more")
        of_plates = any(says(c.address, _OF_PLATES) for c in self.columns)
        if of_plates and not self.found.roles() & {"wheel_speed", "wheel_angle", "slip"}:
            lines.append("# Plate or shear tests, it seems: `soilml bevameter` takes those.")
        notes = dict.fromkeys(note for log in self.logs for r in log for note in r.notes)
        return lines + [f"# Note: {note}" for note in list(notes)[:5]]

    def _wheel_tables(self, drafts: Mapping[str, Draft]) -> list[WrittenTable]:
        """[wheel]: the radius that the logs state, or a line that asks for it; and [gears]."""
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
        if key := next((key for key in ("radius", "diameter") if key in stated), ""):
            value, line = stated[key]
            asked = Marked(f"stated in the {line}") if "CHANGE" in line else ""
            value = value if " " in value else f"{value} m"
            wheel.put(key, f"{value} +- 1 %", asked or f"stated in the log: {line[:60]}")
            return [wheel]
        roles = self.found.roles()
        needed = bool({"wheel_speed", "wheel_angle"} & roles) and not {"slip", "rim_speed"} & roles
        inputs, ratio, hint = inputs_of(drafts, self.run, self.steady) if needed else None, 0.0, ""
        if inputs is not None:
            ratio = implied_radius(drafts, driving_means(inputs, 2.0))
        if ratio > 0.0 and not math.isnan(ratio):
            hint = f"; travel over rotation is {ratio:.3g} m"
            hint += (
                " at the lowest slip: a little less" if _PLAUSIBLE[0] < ratio < _PLAUSIBLE[1] else
                ": a unit is wrong, or the rotation is measured before a gearbox"
            )  # fmt: skip
        line = f'# radius = "0.15 m +- 1 %"  # {"NEEDED" if needed else "for checks"}{hint}'
        wheel.after.append(Marked(line) if needed else line)
        return [wheel]

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
