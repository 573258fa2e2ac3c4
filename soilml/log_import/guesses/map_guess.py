"""A guess of the map of logs that nobody has described: `soilml import --init`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from soilml.io.toml_text import toml_value
from soilml.log_import.channels.runs import run_names, runs_of
from soilml.log_import.guesses.assignment import assign, axle_of, by_behaviour
from soilml.log_import.guesses.channel_drafts import add_errors, draft_channels, is_error
from soilml.log_import.guesses.clocks_and_runs import Division, divide, refuse_a_table_of_runs
from soilml.log_import.guesses.columns import candidates_of, describe, liveliest
from soilml.log_import.guesses.constants import agreed_constants, number_in_names, stated_radius
from soilml.log_import.guesses.draft import Draft, driving_means, implied_radius, inputs_of
from soilml.log_import.guesses.evidence import Judge
from soilml.log_import.guesses.role_words import CLEAR, USUAL, is_size, says
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.log_map import LogMap
from soilml.log_import.mapping.written_map import Marked, WrittenMap, WrittenTable, key_line
from soilml.log_import.readers import Progress, read_logs, silent
from soilml.log_import.readers.side_files import log_files
from soilml.log_import.recording import Recording
from soilml.log_import.units import factor

_USUAL, _SHARE = 2.0, 0.15  # Shortest window for long runs, s, and its share of short ones
_MOST_WHEELS = 8  # Wheels that may share a mass, where nothing says how many do
_MOST_LISTED, _LOOKED = 40, 8  # Most columns that are listed, and runs that are looked at
_PLAUSIBLE = (0.02, 0.7)  # Radii of wheels, m
#: Roles that are needed: what may stand for each, and what a map then says.
_NEEDED = {
    "wheel_speed": ({"wheel_angle", "rim_speed", "slip"},
                    ": no column is the rotation of the wheel",
                    ["# [wheel_angle]", "# [wheel_speed]"]),
    "torque": ({"motor_current"}, " for a soil: no column is a torque",
               ["# [torque]", "# [motor_current]"]),
    "ground_speed": ({"position", "slip"}, ": no column is the travel",
                     ["# [ground_speed]",
                      '# value = "0.02 m/s +- 1 %"   # a carriage of constant speed']),
}  # fmt: skip
#: Uncertainty and unit of what logs state in place of a column.
_STATED = {"load": ("1 %", "N"), "ground_speed": ("1 %", "m/s"), "slip": ("0.01", "1")}
_HEAD = """\
# Written by `soilml import --init`. All of it is a guess: look at the lines with
# CHANGE and NEEDED first, then at the units. Values take a unit and an uncertainty:
# "0.15 m +- 1 %". Forward is positive for rotation, travel and torque.
#
# The columns, with the unit that the log states and where 98 % of their values lie:"""


def init_map(logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> str:
    """Look at logs and write a map with guesses, each with its reason, as TOML with comments.

    Guesses come from names, units and the behaviour of the values; checks of seconds of driving
    mark what they doubt. What no log shows, such as the radius, is marked with CHANGE or NEEDED.

    Raises `InputError` where a file cannot be read or has no columns.
    """
    return draft_map(logs).text


def draft_map(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], progress: Progress = silent
) -> WrittenMap:
    """The map of which `init_map` gives the text."""
    recordings = read_logs(log_files(logs), progress)
    for log in recordings:
        refuse_a_table_of_runs(log)
    return _Guess(recordings).map()


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

    def map(self) -> WrittenMap:
        """The whole map, with a mark on the channels that lack evidence."""
        shared, wheels = self.found.shared, self.found.wheels
        drafts, evidence = self._drafts()
        first = next(iter(drafts.values()))
        tables = [*self.division.tables, self._wheel_table(first)]
        if "load" not in self.found.roles():
            tables.append(self._absent_load())
        for role, (_, what) in ROLES.items():
            if role in shared:
                tables.append(replace(first[role], path=role, about=what))
            elif role not in self.found.roles() and role != "load":
                tables += filter(None, [self._absent(role)])
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
        return WrittenMap(self._head(), tables, evidence)

    def _drafts(self) -> tuple[dict[str, dict[str, Draft]], str]:
        """The channels of each wheel, of "" where there is one, and the evidence for them."""
        stated, found = self.stated.common, self.found
        judge = Judge(stated_radius(stated), self._weight(), found.others, self.usable,
                      self.reasons, not self.steady)  # fmt: skip
        explained = []
        drafts: dict[str, dict[str, Draft]] = {}
        for name, own in (found.wheels or {"": {}}).items():
            group = draft_channels(found.shared | own, self.run, self.steady, stated, found.parts)
            judge.weigh(group, inputs_of(group, self.run, self.steady))
            explained += [f"wheel {name}\n" if name else ""]
            explained += [draft.evidence for draft in group.values()]
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
        of_plates = any(says(c.address, "plates") for c in self.columns)
        if of_plates and not self.found.roles() & {"wheel_speed", "wheel_angle", "slip"}:
            lines.append("# Plate or shear tests, it seems: `soilml bevameter` takes those.")
        notes = dict.fromkeys(note for log in self.logs for r in log for note in r.notes)
        return lines + [f"# Note: {note}" for note in list(notes)[:5]]

    def _wheel_table(self, drafts: Mapping[str, Draft]) -> WrittenTable:
        """[wheel]: the radius that the logs state, or a line that asks for it."""
        wheel, stated = WrittenTable("wheel"), self.stated.common
        if key := next((key for key in ("radius", "diameter") if key in stated), ""):
            value, line = stated[key]
            asked = Marked(f"stated in the {line}") if "CHANGE" in line else ""
            value = value if " " in value else f"{value} m"
            wheel.put(key, f"{value} +- 1 %", asked or f"stated in the log: {line[:60]}")
            return wheel
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
        return wheel

    def _window_tables(self) -> list[WrittenTable]:
        """[windows], with shorter windows for short runs, and an example of [[leave_out]]."""
        lengths = sorted(times[-1] - times[0] for run in self.runs for times in run.times)
        middle = lengths[len(lengths) // 2] if lengths else 0.0
        shortest = min(_USUAL, float(f"{max(_SHARE * middle, 0.05):.1g}"))
        table = WrittenTable("windows", about="steady windows: each becomes a row")
        table.put("shortest", f"{shortest:g} s")
        table.put("settle", f"{min(0.5, shortest / 4.0):g} s", "left out after each change")
        table.put("sensitivity", 1, "2 finds smaller changes, 0.5 only larger ones")
        example = [
            "# [[leave_out]]  # a stretch that somebody disturbed",
            f'# run = "{self.runs[0].name}"',
            "# from = 12.0  # s",
            '# why = "the carriage was pulled"',
        ]
        return [table, WrittenTable(before=example)]

    def _absent_load(self) -> WrittenTable:
        """What stands for a load that no column has: what logs or names say, or the mass."""
        common = self.stated.common
        if said := self._said("load", logs="mass" not in common):
            return said
        count, why = max(1, len(self.found.wheels), len(self.division.labels)), ""
        if count == 1:
            number, line = common.get("wheels", ("1", ""))
            why = f"stated in the log: {line[:60]}" if line else ""
            count, why = int(number), why or Marked("CHANGE: how many wheels carry this mass")
        table = WrittenTable(before=["# No column is a vertical load: it follows from the mass."])
        if "mass" in common:
            table.path = "vehicle"
            value, line = common["mass"]
            table.put("mass", f"{value} +- 1 %", f"stated in the log: {line[:60]}")
            table.put("wheels", count, why)
            return table
        wheels = f"# {key_line('wheels', count, why)}"
        table.after = [
            Marked("# [vehicle]                   # NEEDED, or [load] value = '60 N +- 1 N'"),
            '# mass = "6.1 kg +- 0.1 kg"   # all that stands on the wheels',
            Marked(wheels) if isinstance(why, Marked) else wheels,
        ]
        return table

    def _absent(self, role: str) -> WrittenTable | None:
        """What stands for a role other than the load: what is stated or needed, or may be it."""
        roles, others = self.found.roles(), self.found.others.get(role, [])
        travels = {"position", "ground_speed"} & roles
        if (role == "slip" and not travels) or (role == "ground_speed" and "slip" not in roles):
            said = None if "position" in roles else self._said(role)
            if said is not None:
                return said
        if role in _NEEDED and not others:
            instead, what, options = _NEEDED[role]
            needed = Marked(f"# NEEDED{what}. One of these:")
            return None if instead & roles else WrittenTable(before=[needed, *options])
        about = ROLES[role][1]
        if others:
            column = toml_value(others[0].address)
            return WrittenTable(before=[f"# [{role}]  # {about}", f"# column = {column}"])
        if role in ("drawbar_pull", "sinkage") and (names := self._perhaps(role)):
            shown = ", ".join(names[:4])
            line = Marked(f"# [{role}]  # CHANGE: perhaps one of {shown} is {about}")
            return WrittenTable(before=[line, f"# column = {names[0]}"])
        return None

    def _said(self, role: str, logs: bool = True) -> WrittenTable | None:
        """The table of a role that the lines before the headers state, of all logs or of each, or
        whose number stands in the names of all runs.
        """
        std, unit = _STATED[role]
        if logs and role in self.stated.common:
            value, line = self.stated.common[role]
            why = f"stated in the log: {line[:60]}"
            return WrittenTable(role, {"value": f"{value} +- {std}"}, {"value": why})
        if logs and role in self.stated.of_each:
            pattern, own, values = self.stated.of_each[role]
            if role == "slip" and any(float(value.split()[0]) > 1.0 for value in values):
                unit = "%"
            table = WrittenTable(role)
            table.put("head", pattern, f"the logs state {', '.join(values[:4])}")
            table.put("unit", own or unit)
            if role == "slip":
                why = Marked("CHANGE: how far the slip may be from what was set")
                table.put("noise", 0.01, why)
            return table
        if (in_name := number_in_names(role, self.run_names)) is None:
            return None
        pattern, unit, numbers = in_name
        why = f"the names say {', '.join(f'{n:g}' for n in numbers[:4])}"
        return WrittenTable(role, {"file_name": pattern, "unit": unit}, {"file_name": why})

    def _perhaps(self, role: str) -> list[str]:
        """Columns of the unit of a role that nothing uses and that vary: one may be the role."""
        groups = [self.found.shared, *self.found.wheels.values()]
        used = {c.address for own in groups for c in own.values()}
        used |= {c.address for own in self.found.parts.values() for c in own}
        return [
            toml_value(c.address) for c in self.usable
            if c.address not in used and not c.constant
            and (c.kind == ROLES[role][0] or (c.kind is None and c.score("position") > 0.0))
            and not (role == "sinkage" and c.travel > 0.6)
            and all(score < CLEAR for other, score in c.scores.items() if other != role)
        ]  # fmt: skip
