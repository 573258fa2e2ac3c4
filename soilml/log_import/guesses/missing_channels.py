"""Lines of a new map for channels that no column has."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.guesses.columns import Candidate, words_of
from soilml.log_import.guesses.constants import StatedConstants, number_in_names
from soilml.log_import.guesses.draft import Marked, key_line, toml_value
from soilml.log_import.guesses.evidence import unused_of, used_columns
from soilml.log_import.guesses.roles import Assignment
from soilml.log_import.mapping.channel_map import ROLES

_GLOBE = {"lat", "latitude", "lon", "lng", "long", "longitude"}  # Words of a place in degrees
#: Words of a torque, also in the name of the force that measures it on a lever.
_OF_TORQUE = {"torque", "moment", "drehmoment", "couple", "par", "coppia"}


def load_lines(
    found: Assignment, stated: StatedConstants, run_names: Sequence[str], labels: int = 1
) -> list[str]:
    """What stands for the load where no column is one: what logs or names say, or the mass.

    `labels` is the number of wheels that a column of the log distinguishes.
    """
    if "load" in found.roles():
        return []
    said = [] if {"load", "mass"} <= stated.common.keys() else _said("load", stated, "1 %", "N")
    said = said or _said_by_names("load", run_names)
    if said:
        return said
    count, why = max(1, len(found.wheels), labels), ""
    if count == 1:
        why = Marked("CHANGE: how many wheels carry this mass")
        if "wheels" in stated.common:
            number, line = stated.common["wheels"]
            count, why = int(number), f"stated in the log: {line[:60]}"
    lines = ["", "# No column is a vertical load: it follows from the mass."]
    wheels = key_line("wheels", count, why)
    if "mass" in stated.common:
        return [*lines, "[vehicle]", _stated_line("mass", stated.common["mass"], "1 %"), wheels]
    return [
        *lines,
        Marked("# [vehicle]                   # NEEDED, or [load] value = '60 N +- 1 N'"),
        '# mass = "6.1 kg +- 0.1 kg"   # all that stands on the wheels',
        Marked(f"# {wheels}") if isinstance(wheels, Marked) else f"# {wheels}",
    ]


def _stated_line(key: str, stated: tuple[str, str], std: str) -> str:
    value, line = stated
    return key_line(key, f"{value} +- {std}", f"stated in the log: {line[:60]}")


def _said(role: str, stated: StatedConstants, std: str, unit: str) -> list[str]:
    """The table of a role that the lines before the headers state, of all logs or of each."""
    if role in stated.common:
        return ["", f"[{role}]", _stated_line("value", stated.common[role], std)]
    if role not in stated.of_each:
        return []
    pattern, own, values = stated.of_each[role]
    return [
        "",
        f"[{role}]",
        key_line("head", pattern, f"the logs state {', '.join(values[:4])}"),
        key_line("unit", own or unit),
    ]


def _said_by_names(role: str, run_names: Sequence[str]) -> list[str]:
    """The table of a role whose number stands in the names of all runs."""
    in_name = number_in_names(role, run_names)
    if in_name is None:
        return []
    pattern, unit, numbers = in_name
    shown = ", ".join(f"{n:g}" for n in numbers[:4])
    line = key_line("file_name", pattern, f"the names say {shown}")
    return ["", f"[{role}]", line, key_line("unit", unit)]


def _slip_lines(stated: StatedConstants, run_names: Sequence[str]) -> list[str]:
    """A slip that was set, as the heads or the names of the logs say."""
    values = stated.of_each["slip"][2] if "slip" in stated.of_each else []
    large = any(float(value.split()[0]) > 1.0 for value in values)
    if not (lines := _said("slip", stated, "0.01", "%" if large else "1")):
        return _said_by_names("slip", run_names)
    if "slip" not in stated.common:
        why = Marked("CHANGE: how far the slip may be from what was set")
        lines.append(key_line("noise", 0.01, why))
    return lines


def absent_lines(
    role: str,
    found: Assignment,
    columns: Sequence[Candidate],
    stated: StatedConstants,
    run_names: Sequence[str],
) -> list[str]:
    """What stands for another role that no column has: what is needed, or the runner-up."""
    roles, others = found.roles(), found.others.get(role, [])
    if (
        role == "slip"
        and not {"position", "ground_speed"} & roles
        and (lines := _slip_lines(stated, run_names))
    ):
        return lines
    rotation = {"wheel_speed", "wheel_angle", "rim_speed", "slip"} & roles
    if role == "wheel_speed" and not rotation and not others:
        commanded = [c.address for c in columns if "slip" in words_of(c.name)]
        return [
            "",
            Marked("# NEEDED: no column is the rotation of the wheel. One of these:"),
            "# [wheel_angle]",
            "# [wheel_speed]",
            *(f"# [slip]  # column = {toml_value(name)}" for name in commanded),
        ]
    travel = {"position", "slip"} & roles
    if role == "ground_speed" and not travel and (lines := _said(role, stated, "1 %", "m/s")):
        return lines
    if role == "torque" and not ("motor_current" in roles or others):
        forces = [c for c in columns if c.kind == "N" and _OF_TORQUE & {*words_of(c.name)}]
        needed = Marked("# NEEDED for a soil: no column is a torque. One of these:")
        lines = ["", needed, "# [torque]"]
        for c in forces:
            lines.append(f"# column = {toml_value(c.address)}")
            lines.append('# scale = "0.2 N m +- 1 %"  # 1 N on a lever arm of 0.2 m')
        return [*lines, "# [motor_current]"]
    if role == "ground_speed" and not (travel or others):
        degrees = [c.address for c in columns if _GLOBE & {*words_of(c.name)}]
        return [
            "",
            *(
                f"# {name}: degrees on the globe are no place; add columns in m, north and east"
                for name in degrees
            ),
            Marked("# NEEDED: no column is the travel. One of these:"),
            "# [ground_speed]",
            '# value = "0.02 m/s +- 1 %"   # a carriage of constant speed',
        ]
    used = used_columns(found.shared, found.parts)
    for own in found.wheels.values():
        used |= used_columns(own, {})
    if (
        not others
        and role in ("drawbar_pull", "sinkage")
        and (names := unused_of(role, ROLES[role][0], columns, used))
    ):
        shown = ", ".join(map(toml_value, names[:4]))
        line = f"# [{role}]  # CHANGE: perhaps one of {shown} is {ROLES[role][1]}"
        return ["", Marked(line), f"# column = {toml_value(names[0])}"]
    if others:
        column = toml_value(others[0].address)
        return ["", f"# [{role}]  # {ROLES[role][1]}", f"# column = {column}"]
    return []
