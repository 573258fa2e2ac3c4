"""Tables of a guess for channels that no column has: what logs state, or what is needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from soilml.io.toml_text import toml_value
from soilml.log_import.guesses.assignment import Assignment
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.constants import StatedConstants, number_in_names
from soilml.log_import.guesses.role_words import CLEAR
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.mapping.written_map import Marked, WrittenTable, key_line

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


@dataclass(frozen=True)
class AbsentChannels:
    """What stands for the roles of a guess that have no column."""

    found: Assignment
    columns: Sequence[Candidate]
    stated: StatedConstants
    run_names: Sequence[str]

    def load(self, labels: int) -> WrittenTable:
        """The load: what logs or names say, or the mass.

        labels: The number of wheels that a column of the log distinguishes.
        """
        common = self.stated.common
        if said := self._said("load", logs="mass" not in common):
            return said
        count, why = max(1, len(self.found.wheels), labels), ""
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

    def table(self, role: str) -> WrittenTable | None:
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
            toml_value(c.address) for c in self.columns
            if c.kind == ROLES[role][0] and c.address not in used and not c.constant
            and not (role == "sinkage" and c.travel > 0.6)
            and all(score < CLEAR for other, score in c.scores.items() if other != role)
        ]  # fmt: skip
