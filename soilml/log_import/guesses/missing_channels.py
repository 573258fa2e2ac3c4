"""Lines of a new map for channels that no column has."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.guesses.columns.assignment import Assignment
from soilml.log_import.guesses.columns.candidates import Candidate
from soilml.log_import.guesses.columns.column_words import words_of
from soilml.log_import.guesses.stated_constants import number_in_names
from soilml.log_import.guesses.toml_value import toml_value
from soilml.log_import.mapping.channel import ROLES


def load_lines(
    found: Assignment,
    stated: dict[str, tuple[str, str]],
    heads: dict[str, tuple[str, str, list[str]]],
    run_names: Sequence[str],
) -> list[str]:
    """What stands for the load where no column is one: what logs or names say, or the mass."""
    if "load" in found.roles():
        return []
    if "load" in stated and "mass" not in stated:
        value, line = stated["load"]
        return ["", "[load]", f'value = "{value} +- 1 %"  # stated in the log: {line[:60]}']
    if "load" in heads:
        pattern, unit, stated_there = heads["load"]
        return [
            "",
            "[load]",
            f"head = {toml_value(pattern)}  # the logs state {', '.join(stated_there[:4])}",
            f"unit = {toml_value(unit or 'N')}",
        ]
    in_name = number_in_names("load", run_names)
    if in_name is not None:
        pattern, unit, numbers = in_name
        shown = ", ".join(f"{n:g}" for n in numbers[:4])
        return [
            "",
            "[load]",
            f"file_name = {toml_value(pattern)}  # the names say {shown}",
            f"unit = {toml_value(unit)}",
        ]
    count = max(1, len(found.wheels))
    mass = stated.get("mass", ("", ""))[0]
    lines = ["", "# No column is a vertical load: it follows from the mass."]
    if mass:
        return [*lines, "[vehicle]", f'mass = "{mass} +- 1 %"', f"wheels = {count}"]
    return [
        *lines,
        "# [vehicle]                   # NEEDED, or [load] value = '60 N +- 1 N'",
        '# mass = "6.1 kg +- 0.1 kg"   # all that stands on the wheels',
        f"# wheels = {count}",
    ]


def absent_lines(
    role: str, found: Assignment, columns: Sequence[Candidate], run_names: Sequence[str]
) -> list[str]:
    """What stands for another role that no column has: what is needed, or the runner-up."""
    others: list[Candidate] = found.others.get(role, [])
    if role == "slip" and not ({"position", "ground_speed"} & found.roles()):
        in_name = number_in_names("slip", run_names)
        if in_name is not None:
            return [
                "",
                "[slip]",
                f"file_name = {toml_value(in_name[0])}",
                f"unit = {toml_value(in_name[1])}",
            ]
    rotation = {"wheel_speed", "wheel_angle", "rim_speed", "slip"} & found.roles()
    if role == "wheel_speed" and not rotation and not others:
        commanded = [c.address for c in columns if "slip" in words_of(c.name)]
        return [
            "",
            "# NEEDED: no column is the rotation of the wheel. One of these:",
            "# [wheel_angle]",
            "# [wheel_speed]",
            *(f"# [slip]  # column = {toml_value(name)}" for name in commanded),
        ]
    if role == "ground_speed" and not ({"position", "slip"} & found.roles() or others):
        return [
            "",
            "# NEEDED: no column is the travel. One of these:",
            "# [ground_speed]",
            '# value = "0.02 m/s +- 1 %"   # a carriage of constant speed',
        ]
    if others:
        column = toml_value(others[0].address)
        return ["", f"# [{role}]  # {ROLES[role][1]}", f"# column = {column}"]
    return []
