"""Lines of a new map for channels that no column has."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.guesses.columns import Candidate, words_of
from soilml.log_import.guesses.constants import number_in_names
from soilml.log_import.guesses.draft import toml_value
from soilml.log_import.guesses.roles import Assignment
from soilml.log_import.mapping.channel_map import ROLES

#: Words of a place in degrees.
_GLOBE = {"lat", "latitude", "lon", "lng", "long", "longitude"}
#: Words of a torque, also in the name of the force that measures it on a lever.
_OF_TORQUE = {"torque", "moment", "drehmoment", "couple", "par", "coppia"}


def load_lines(
    found: Assignment,
    stated: dict[str, tuple[str, str]],
    heads: dict[str, tuple[str, str, list[str]]],
    run_names: Sequence[str],
    labels: int = 1,
) -> list[str]:
    """What stands for the load where no column is one: what logs or names say, or the mass.

    `labels` is the number of wheels that a column of the log tells apart.
    """
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
    count, why = max(1, len(found.wheels), labels), ""
    if count == 1:
        why = "  # CHANGE: how many wheels carry this mass"
        if "wheels" in stated:
            count, why = (
                int(stated["wheels"][0]),
                f"  # stated in the log: {stated['wheels'][1][:60]}",
            )
    mass, line = stated.get("mass", ("", ""))
    lines = ["", "# No column is a vertical load: it follows from the mass."]
    if mass:
        return [
            *lines,
            "[vehicle]",
            f'mass = "{mass} +- 1 %"  # stated in the log: {line[:60]}',
            f"wheels = {count}{why}",
        ]
    return [
        *lines,
        "# [vehicle]                   # NEEDED, or [load] value = '60 N +- 1 N'",
        '# mass = "6.1 kg +- 0.1 kg"   # all that stands on the wheels',
        f"# wheels = {count}{why}",
    ]


def _slip_of_heads(
    stated: dict[str, tuple[str, str]], heads: dict[str, tuple[str, str, list[str]]]
) -> list[str]:
    """A slip that the lines before the headers state, of all logs together or of each its own."""
    if "slip" in stated:
        value, line = stated["slip"]
        return ["", "[slip]", f'value = "{value} +- 0.01"  # stated in the log: {line[:60]}']
    if "slip" not in heads:
        return []
    pattern, unit, values = heads["slip"]
    large = max(float(value.split()[0]) for value in values) > 1.0
    return [
        "",
        "[slip]",
        f"head = {toml_value(pattern)}  # the logs state {', '.join(values[:4])}",
        f"unit = {toml_value(unit or ('%' if large else '1'))}",
        "noise = 0.01  # CHANGE: how far the slip may be from what was set",
    ]


def absent_lines(
    role: str,
    found: Assignment,
    columns: Sequence[Candidate],
    run_names: Sequence[str],
    stated: dict[str, tuple[str, str]],
    heads: dict[str, tuple[str, str, list[str]]],
) -> list[str]:
    """What stands for another role that no column has: what is needed, or the runner-up."""
    others: list[Candidate] = found.others.get(role, [])
    if role == "slip" and not ({"position", "ground_speed"} & found.roles()):
        if lines := _slip_of_heads(stated, heads):
            return lines
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
    if role == "ground_speed" and not {"position", "slip"} & found.roles():
        if "ground_speed" in stated:
            value, line = stated["ground_speed"]
            return ["", "[ground_speed]",
                    f'value = "{value} +- 1 %"  # stated in the log: {line[:60]}']  # fmt: skip
        if "ground_speed" in heads:
            pattern, unit, values = heads["ground_speed"]
            return ["", "[ground_speed]",
                    f"head = {toml_value(pattern)}  # the logs state {', '.join(values[:4])}",
                    f"unit = {toml_value(unit or 'm/s')}"]  # fmt: skip
    if role == "torque" and not ("motor_current" in found.roles() or others):
        return [
            "",
            "# NEEDED for a soil: no column is a torque. One of these:",
            "# [torque]",
            *(
                line
                for c in columns
                if c.kind == "N" and _OF_TORQUE & {*words_of(c.name)}
                for line in (
                    f"# column = {toml_value(c.address)}",
                    '# scale = "0.2 N m +- 1 %"  # 1 N on a lever arm of 0.2 m',
                )
            ),
            "# [motor_current]",
        ]
    if role == "ground_speed" and not ({"position", "slip"} & found.roles() or others):
        degrees = [c.address for c in columns if _GLOBE & {*words_of(c.name)}]
        return [
            "",
            *(
                f"# {name}: degrees on the globe are no place; add columns in m, north and east"
                for name in degrees
            ),
            "# NEEDED: no column is the travel. One of these:",
            "# [ground_speed]",
            '# value = "0.02 m/s +- 1 %"   # a carriage of constant speed',
        ]
    if others:
        column = toml_value(others[0].address)
        return ["", f"# [{role}]  # {ROLES[role][1]}", f"# column = {column}"]
    return []
