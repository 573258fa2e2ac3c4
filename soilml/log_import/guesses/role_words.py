"""The roles that columns may have: units, words of their names, and what is usual of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from soilml.log_import.mapping.channel_map import ROLES
from soilml.optional_imports import tomllib


@dataclass(frozen=True)
class Role:
    """What is usual of the columns of a role.

    sizes: The unit where none is stated: that of the first least size which the values reach.
    also: Kinds of units that a column may have beside that of `ROLES`.
    alone: Kinds of units that make a column a candidate whatever its name is.
    per_wheel: Whether each wheel has a column of its own.
    together: Most columns that one wheel has in this role.
    raw: Whether it may be shown in volts or counts, which need the calibration of the sensor.
    positive: Why it is positive while the wheel drives forward; "" where it need not be.
    zero: Whether it reads zero where the wheel rests.
    bias: Calibration error that all rows share, where nothing states one.
    """

    sizes: tuple[tuple[float, str], ...] = ()
    also: tuple[str, ...] = ()
    alone: tuple[str, ...] = ()
    per_wheel: bool = True
    together: int = 1
    raw: bool = False
    positive: str = ""
    zero: bool = False
    bias: str = ""


#: Largest fraction that a column of slip may hold, and the least one of per cent: (r omega - v)/v
#: lies between.
MOST_FRACTION, LEAST_PERCENT = 1.0, 5.0
_SPEEDS = ((8.0, "mm/s"), (3.0, "cm/s"), (0.0, "m/s"))
_DRIVES, _NEWTON = "positive where it drives forward", ((0.0, "N"),)
USUAL = {
    "wheel_speed": Role(((0.0, "rad/s"),), ("count/s",), ("rad/s",)),
    "wheel_angle": Role((), ("count",), ("count",)),
    "rim_speed": Role(_SPEEDS),
    "ground_speed": Role(_SPEEDS, (), ("m/s",), per_wheel=False),
    "position": Role(((25.0, "mm"), (0.0, "m")), ("count",), ("m",), per_wheel=False, raw=True),
    "slip": Role(((LEAST_PERCENT, "%"), (0.0, "1"))),
    "torque": Role(
        ((300.0, "mN m"), (0.0, "N m")), ("1",), ("N m",), raw=True, positive=_DRIVES, zero=True,
        bias="2 %",
    ),
    "motor_current": Role(
        ((60.0, "mA"), (0.0, "A")), ("1",), ("A",), raw=True, positive=_DRIVES, zero=True
    ),
    "load": Role(
        _NEWTON, ("kg",), ("N",), together=8, raw=True, positive="a load is positive", bias="1 %"
    ),
    "drawbar_pull": Role(_NEWTON, ("kg",), together=8, raw=True, zero=True),
    "sinkage": Role(
        ((1.0, "mm"), (0.0, "m")), together=4, raw=True, positive="sinkage is positive"
    ),
    "slope": Role(((1.2, "deg"), (0.0, "rad")), per_wheel=False),
}  # fmt: skip
#: Score from which a name says the role whatever the topic is called; least letters of a word that
#: says it in full.
CLEAR, _FULL = 4.0, 4
#: Groups of words that say which wheel a column belongs to.
WHEEL_WORDS = ("places", "corners", "numbers")
#: Words of columns with the size of the wheel of each row, and their signs alone.
_SIZES = re.compile(
    r"radius|radio|rayon|raggio|dia|diam|di[aáà]m[eèé]tr[eo]|diameter|durchmesser|width|breite|"
    r"largeur|ancho|larghezza|grouser|lug|cleat|stollen"
)
_SIGNS_OF_SIZES = re.compile(r"[rdb][ _]?w?", re.IGNORECASE)
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_WORD = re.compile(r"[^\W\d_]+|\d+")


def kinds_of(role: str) -> tuple[str, ...]:
    """The kinds of units that the columns of a role may have."""
    return ROLES[role][0], *USUAL[role].also


def words_of(name: str) -> list[str]:
    """The words of a column's name in small letters: `WheelSpeed_FL` -> wheel, speed, fl."""
    return [word.lower() for word in _WORD.findall(_CAMEL.sub(" ", name))]


@cache
def _content() -> dict[str, Any]:
    """The file beside this one."""
    return tomllib.loads(Path(__file__).with_name("role_words.toml").read_text(encoding="utf-8"))


@cache
def group(*names: str) -> tuple[str, ...]:
    """The words of groups of [words] in the file beside this one."""
    return tuple(word for name in names for word in _content()["words"][name].split())


def says(name: str, *groups: str) -> bool:
    """Whether a name has a word of these groups."""
    return not {*group(*groups)}.isdisjoint(words_of(name))


def is_size(name: str) -> bool:
    """Whether a name is that of a radius, a diameter or a width, or of grousers."""
    words = parts_of(words_of(name))
    return bool(_SIGNS_OF_SIZES.fullmatch(name) or any(map(_SIZES.fullmatch, words)))


def parts_of(words: Sequence[str]) -> list[str]:
    """Words with German compounds as their two parts: raddrehzahl -> rad, drehzahl."""
    found = []
    for word in words:
        head = next((h for h in group("heads") if word.endswith(h) and len(word) > len(h) + 2), "")
        found += [word.removesuffix(head), head] if head else [word]
    return found


def wheel_word(name: str) -> tuple[str, ...]:
    """The words of a name that say which wheel it belongs to, such as ("front", "left").

    The number of a bus or of an input is none.
    """
    words = words_of(name)
    return tuple(
        word for word, last in zip(words, ["", *words], strict=False)
        if word in group(*WHEEL_WORDS) and not (word.isdigit() and last in group("buses"))
    )  # fmt: skip


@cache
def _patterns() -> dict[str, list[tuple[float, re.Pattern[str]]]]:
    """Role -> weights and patterns."""
    return {
        role: [(float(weight), re.compile(pattern)) for weight, pattern in entries]
        for role, entries in _content().items() if role != "words"
    }  # fmt: skip


def _readings_of(name: str) -> Iterator[str]:
    """The words of a name, without those of the place and without fillers, parts of compounds too.

    In "velocity front left wheel", a velocity of a wheel, words of the place stand between.
    """
    words = words_of(name)
    for own in (words, parts_of(words)):
        for left_out in ((), ("places",), ("fillers",), ("places", "fillers")):
            yield " ".join(word for word in own if word not in group(*left_out))


def name_scores(name: str) -> dict[str, float]:
    """How well a name fits each role; roles that it does not fit are left out."""
    texts, scores = {*_readings_of(name)}, {}
    for role, patterns in _patterns().items():
        fits = [w for w, pattern in patterns if any(map(pattern.search, texts))]
        if best := max([w for w in fits if w > 0], default=0.0):
            scores[role] = best + sum(w for w in fits if w < 0)
    return scores


@cache
def _known_words() -> frozenset[str]:
    """The words of all roles, and those that may stand beside them."""
    patterns = (pattern.pattern for own in _patterns().values() for _, pattern in own)
    words = (word for text in patterns for word in _WORD.findall(re.sub(r"\\.", " ", text)))
    return frozenset({*words, *group(*WHEEL_WORDS, "fillers", "beside")})


def says_role(role: str, name: str) -> bool:
    """Whether a name has a full word of a role, and no word that may make it another quantity.

    A letter, an axis or a short sign is none; of `water depth` nobody knows the first word.
    """
    if name_scores(name).get(role, 0.0) < CLEAR:
        return False
    known = _known_words()
    for word in words_of(name):
        plain = word.isascii() and len(word) > 2 and word.isalpha()
        if plain and known.isdisjoint({word, *parts_of([word])}):
            return False
    found = [
        match[0]
        for weight, pattern in _patterns()[role] if weight >= CLEAR
        for text in _readings_of(name) for match in pattern.finditer(text)
    ]  # fmt: skip
    return any(len(w) >= _FULL or not w.isascii() for text in found for w in text.split())
