"""Constants that logs state in the lines before their headers, or in the names of their files."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from soilml.log_import.recording import Recording
from soilml.log_import.units import dimension, factor

#: Constants by name: as they would be written in a map, and the line that states them.
Stated = dict[str, tuple[str, str]]

_VALUE = r"\s*(?:\[[^\]]*\]|\([^)]*\))?\s*[:=,;\t ][:=,;\s]*"
_VALUE += r"([+-]?[0-9]+(?:[.,][0-9]+)?)\s*([A-Za-z/%°*^0-9-]*)"
_UNIT_BEFORE = re.compile(r"(?:[\[(]\s*([^\])]*)\s*[\])]|_(mm|cm|m|kg|n)\b)", re.IGNORECASE)
#: Constant -> words before the number, and the unit that it must have.
_STATED = {
    "radius": (
        r"(?:wheel[ _]?|rad)?(?:radius|radius[ _]wheel|wheel[ _]r|r[ _]?wheel|r(?=\s*[=:])"
        r"|(?:rayon|radio|raggio)(?: \w+){0,3})",
        "m",
    ),
    "diameter": (
        r"(?:wheel[ _]?|rad)?(?:diameter|durchmesser|di[aáà]m[eèé]tr[eo](?: \w+){0,3})",
        "m",
    ),
    "rate": (r"(?:sampl\w*[ _]?(?:rate|freq\w*)|rate|fs|frequency|abtastrate)", "Hz"),
    "gear_ratio": (r"(?:gear\w*[ _]?(?:ratio)?|ratio|getriebe\w*|reduction)", "1"),
    "torque_constant": (r"(?:torque[ _]?const\w*|kt|k_t|km)", "N m/A"),
    "efficiency": (r"(?:gear[ _]?)?(?:efficiency|eta|wirkungsgrad)", "1"),
    "counts_per_turn": (r"(?:cpr|ppr|counts[ _]?per[ _]?(?:turn|rev\w*)|resolution)", "1"),
    "mass": (r"(?:mass|masse|rover[ _]?mass|vehicle[ _]?mass)", "kg"),
    "ground_speed": (
        r"(?:carriage|cart|travel|trolley|ground|traverse|forward|wagen|schlitten|vorschub)[ _]?"
        r"(?:speed|velocity|feed|geschwindigkeit)",
        "m/s",
    ),
    "slip": (r"(?:target|set|commanded|nominal|soll)?[ _-]?(?:slip|schlupf)(?:[ _]?ratio)?", "1"),
    "load": (r"(?:normal[ _]?|vertical[ _]?|wheel[ _]?)?(?:load|weight)", "N"),
}
_WHEELS = re.compile(
    r"\b([0-9]{1,2})[ -]?wheel(?:s|ed)\b|\bwheels\s*[:=,;]\s*([0-9]{1,2})\b", re.IGNORECASE
)
#: Numbers in names of files: role, pattern and unit.
_IN_NAMES = (
    ("load", r"(?<![a-z])(?:load|w|fz|fn|n)[_=-]?(\d+(?:[.p]\d+)?)n?(?![a-z0-9])", "N"),
    ("load", r"(?<![a-z0-9.])(\d+(?:\.\d+)?)n(?![a-z0-9])", "N"),
    ("load", r"(?<![a-z0-9.])(?:load|weight|w|m|fz|fn)?[_=-]?(\d+(?:\.\d+)?)kg(?![a-z0-9])", "kgf"),
    ("slip", r"(?<![a-z])(?:slip|s)[_=-]?(\d\d?(?:\.\d+)?)(?:pct|percent|%)?(?![0-9a-z])", "%"),
    ("slip", r"(?<![a-z])(?:slip|s)[_=-]?(-?0\.\d+)(?![0-9])", "1"),
)
#: Constants in names of files: name, and pattern of the number and its unit.
_CONSTANTS_IN_NAMES = tuple(
    (constant, rf"(?<![a-z]){words}[_= -]?(\d+(?:[.p]\d+)?)[_ ]?{unit}(?![a-z0-9])")
    for constant, words, unit in (
        ("radius", r"(?:wheel[_ -]?)?(?:radius|rad)", "(mm|cm|m)?"),
        ("diameter", r"(?:wheel[_ -]?)?(?:diameter|diam|dia|durchmesser)", "(mm|cm|m)?"),
        ("radius", "r", "(mm|cm)"),
        ("diameter", "d", "(mm|cm)"),
        ("gear_ratio", r"(?:gear[_ -]?ratio|gear|gr)", "()"),
    )
)
#: Units of a length without one, and radii of wheels, m.
_LENGTHS, _LEAST, _MOST = (("m", 1.0), ("cm", 0.01), ("mm", 0.001)), 0.02, 0.7
_IN_MM = {"radius": 2.0, "diameter": 4.0}  # Length without a unit above which it is in mm


def stated_constants(lines: Sequence[str]) -> Stated:
    """Constants that lines state."""
    found: Stated = {}
    for line in lines:
        if "wheels" not in found and (wheels := _WHEELS.search(line)):
            found["wheels"] = (wheels[1] or wheels[2], line)
        for name, (words, ours) in _STATED.items():
            text = rf"\b{words}(?:_(?:mm|cm|m|kg|n))?\b{_VALUE}"
            match = None if name in found else re.search(text, line, re.IGNORECASE)
            if match is None:
                continue
            number, unit = match[1].replace(",", "."), match[2].strip()
            inverse = re.match(r"\s*[:/]\s*([0-9]+(?:[.,][0-9]+)?)", line[match.end(1) :])
            if name == "gear_ratio" and float(number) == 1.0 and inverse:  # 1:64
                number = inverse[1].replace(",", ".")
            if math.isinf(float(number)):  # hundreds of digits
                continue
            if not unit and (before := _UNIT_BEFORE.search(line[match.start() : match.start(1)])):
                unit = before[1] or before[2]
            if ours == "Hz" or (unit and dimension(unit) == ours):
                found[name] = (f"{number} {'Hz' if ours == 'Hz' else unit}", line)
            elif dimension(unit) is None:
                in_mm = float(number) > _IN_MM.get(name, math.inf)
                found[name] = (number + " mm" * in_mm, line)
    if "radius" in found:
        found.pop("diameter", None)
    return found


def stated_radius(stated: Stated) -> float:
    """Radius in m that a log states, itself or as a diameter; 0 where it states none."""
    for name, share in (("radius", 1.0), ("diameter", 0.5)):
        if name in stated:
            number, _, unit = stated[name][0].partition(" ")
            return share * float(number) * factor(unit, "m", name)
    return 0.0


@dataclass(frozen=True)
class StatedConstants:
    """Constants that logs state in the lines before their headers, by name."""

    common: Stated  # Those that all logs state alike
    # Those that differ: a pattern for the number in the line, its unit, and the numbers
    of_each: dict[str, tuple[str, str, list[str]]]


def agreed_constants(logs: Sequence[Sequence[Recording]]) -> StatedConstants:
    """The constants that logs state, or the names of their files where all say the same."""
    each = [stated_constants([line for own in log for line in own.about]) for log in logs]
    named = [constants_in_name(log[0].file.stem) for log in logs]
    alike, differing = {}, {}
    for name in dict.fromkeys(name for found in each for name in found):
        said = [found[name] for found in each if name in found]
        values = list(dict.fromkeys(value for value, _ in said))
        value, line = said[0]
        number, _, unit = value.partition(" ")
        start = max(line.find(number), line.find(number.replace(".", ",")))
        if len(values) == 1:
            alike[name] = said[0]
        elif start > 0 and len(said) == len(each):
            pattern = re.escape(line[:start]).replace("\\ ", " ") + r"([+-]?\d+(?:[.,]\d+)?)"
            differing[name] = (pattern, unit, values)
    for name, one in named[0].items():
        same = {"radius", "diameter"} if name in ("radius", "diameter") else {name}
        if not same & alike.keys() and all(own.get(name, ("",))[0] == one[0] for own in named):
            alike[name] = one
    return StatedConstants(alike, differing)


def constants_in_name(name: str) -> Stated:
    """Constants that the name of a file states, as `WHEELDIAMETER25.0_GEARRATIO6` does.

    A length without a unit is taken in that of m, cm and mm which fits a wheel, and says so.
    """
    found: Stated = {}
    for constant, pattern in _CONSTANTS_IN_NAMES:
        match = re.search(pattern, name, re.IGNORECASE)
        if match is None or constant in found or ("radius" in found and constant == "diameter"):
            continue
        number, unit = match[1].replace("p", "."), match[2] or ""
        said = f"name of the file: {match[0]}"
        if constant != "gear_ratio" and not unit:
            size = float(number) / (2.0 if constant == "diameter" else 1.0)
            unit = next((u for u, one in _LENGTHS if _LEAST < size * one < _MOST), "")
            said = f"{said}; CHANGE where that is not {unit}"
        if unit or constant == "gear_ratio":
            found[constant] = (f"{number} {unit}".strip(), said)
    return found


def number_in_names(role: str, names: Sequence[str]) -> tuple[str, str, list[float]] | None:
    """A pattern that finds a number for a role in all names of runs, its unit and the numbers."""
    for kind, pattern, unit in _IN_NAMES:
        matches = [re.search(pattern, name, re.IGNORECASE | re.ASCII) for name in names]
        if kind == role and all(matches):
            return pattern, unit, [float(m[1].replace("p", ".")) for m in matches if m]
    return None
