"""The columns of logs: the words of their names, and how well each fits each role."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.behaviour import Behaviour, behaviour, clock_score
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.recording import Recording
from soilml.log_import.units import dimension, is_raw_signal, spelling, unit_in_name
from soilml.optional_imports import tomllib

#: Words that say which wheel a column belongs to.
_PLACES = ("left", "right", "front", "rear", "middle", "mid", "centre", "center", "back")
WHEEL_WORDS = (
    *("fl", "fr", "rl", "rr", "ml", "mr", "cl", "cr", "bl", "br"),
    *("lf", "rf", "lr", "lm", "rm", "lb", "rb"), *_PLACES, *"12345678",
)  # fmt: skip
#: Words of topics and columns that say nothing of the quantity.
_FILLERS = ("state", "states", "data", "status", "sensor", "feedback", "measured", "actual", "raw",
            "mean", "avg", "average")  # fmt: skip
#: Words that change nothing beside those of a quantity.
_BESIDE = ("rig", "bench", "the", "des", "del", "filtered", "filt", "dynamic", "transducer", "axis",
           "reaction", "fuerza", "forza", "field", "twist", "wrench", "msg", "taux")  # fmt: skip
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_WORD = re.compile(r"[^\W\d_]+|\d+")
#: What a role's unit may be, beside that of `ROLES`.
_ALSO = {
    "wheel_angle": ("count",),
    "wheel_speed": ("count/s",),
    "position": ("count",),
    "load": ("kg",),
    "torque": ("1",),
    "motor_current": ("1",),
    "drawbar_pull": ("kg",),
}
#: Roles that a sensor may show in volts or counts, which need the calibration of the sensor.
CALIBRATED = ("torque", "motor_current", "load", "drawbar_pull", "sinkage", "position")
#: Roles and units of which the unit alone, without a name, makes a column a candidate.
_UNIT_SUFFICES = {
    ("torque", "N m"), ("motor_current", "A"), ("wheel_speed", "rad/s"), ("ground_speed", "m/s"),
    ("position", "m"), ("load", "N"), ("wheel_angle", "count"),
}  # fmt: skip
#: Least load, N, and largest range of a sinkage, mm, of columns without a unit.
_LEAST_LOAD, _MOST_SINKAGE = 1.0, 900.0
_FEWEST_PLACES = 10  # Fewest different values of a travel
CLEAR = 4.0  # Score from which a name says the role whatever the topic is called
_WORD_SCORE, _FULL = 4.0, 4  # Least weight of a full word of a role, and its letters
#: Words whose number is that of a bus, a port or an input, and of no wheel.
_BUSES = {"can", "bus", "port", "node", "adc", "ch", "channel", "ai", "uart", "com", "usb", "dev"}
#: Words of counters of lines, which are no clock however evenly they rise.
COUNTERS = {"seq", "sequence", "count", "counter", "sample", "samples", "index", "idx", "frame",
            "id", "no", "nr", "number", "row", "line", "record"}  # fmt: skip
#: Last parts of German compounds.
_HEADS = ("geschwindigkeit", "drehzahl", "spannung", "pressung", "verschiebung", "durchmesser",
          "radius", "einsinkung", "tiefe", "breite", "länge", "laenge", "fläche", "flaeche",
          "druck", "kraft", "last", "moment", "strom", "winkel", "weg")  # fmt: skip
#: Words of columns with the size of the wheel of each row, and their signs alone.
_SIZES = re.compile(
    r"radius|radio|rayon|raggio|dia|diam|di[aáà]m[eèé]tr[eo]|diameter|durchmesser|width|breite|"
    r"largeur|ancho|larghezza|grouser|lug|cleat|stollen"
)
_SIGNS_OF_SIZES = re.compile(r"[rdb][ _]?w?", re.IGNORECASE)
_SIDE = re.compile(r"(?:(?<=[a-z_. ])[LR]|[_. ]?(?:[lr]|left|right)(?![a-z])|\d)$")
_UNCLEAR = 0.5  # What puts a speed of a side, without another word, before other guesses
_MOST_TEXTS = 12  # Most columns of text that are listed


def words_of(name: str) -> list[str]:
    """The words of a column's name in small letters: `WheelSpeed_FL` -> wheel, speed, fl."""
    return [word.lower() for word in _WORD.findall(_CAMEL.sub(" ", name))]


def says(name: str, known: Collection[str]) -> bool:
    """Whether a name has one of these words."""
    return not {*known}.isdisjoint(words_of(name))


def is_size(name: str) -> bool:
    """Whether a name is that of a radius, a diameter or a width, or of grousers."""
    words = parts_of(words_of(name))
    return bool(_SIGNS_OF_SIZES.fullmatch(name) or any(map(_SIZES.fullmatch, words)))


def parts_of(words: Sequence[str]) -> list[str]:
    """Words with German compounds as their two parts: raddrehzahl -> rad, drehzahl."""
    found = []
    for word in words:
        head = next((h for h in _HEADS if word.endswith(h) and len(word) > len(h) + 2), "")
        found += [word.removesuffix(head), head] if head else [word]
    return found


@cache
def _patterns() -> dict[str, list[tuple[float, re.Pattern[str]]]]:
    """Role -> weights and patterns, from the file beside this one."""
    text = Path(__file__).with_name("column_words.toml").read_text(encoding="utf-8")
    return {
        role: [(float(weight), re.compile(pattern)) for weight, pattern in entries]
        for role, entries in tomllib.loads(text).items()
    }


def name_scores(name: str) -> dict[str, float]:
    """How well a name fits each role; roles that it does not fit are left out."""
    words = words_of(name)
    # "velocity front left wheel" is a velocity of a wheel: words of the place stand between
    texts = {
        " ".join(word for word in own if word not in left_out)
        for own in (words, parts_of(words))
        for left_out in ((), _PLACES, _FILLERS, (*_PLACES, *_FILLERS))
    }
    scores = {}
    for role, patterns in _patterns().items():
        fits = [w for w, pattern in patterns if any(pattern.search(text) for text in texts)]
        best = max([w for w in fits if w > 0], default=0.0)
        if best:
            scores[role] = best + sum(w for w in fits if w < 0)
    return scores


@cache
def _known_words() -> frozenset[str]:
    """The words of all roles, and those that may stand beside them."""
    patterns = (pattern.pattern for own in _patterns().values() for _, pattern in own)
    words = (word for text in patterns for word in _WORD.findall(re.sub(r"\\.", " ", text)))
    return frozenset({*words, *WHEEL_WORDS, *_FILLERS, *_BESIDE})


def says_role(role: str, name: str) -> bool:
    """Whether a name has a full word of a role, and no word that may make it another quantity.

    A letter, an axis or a short sign is none; of `water depth` nobody knows the first word.
    """
    words = words_of(name)
    if name_scores(name).get(role, 0.0) < _WORD_SCORE:
        return False
    known = _known_words()
    if any(word.isascii() and len(word) > 2 and word.isalpha() and word not in known
           and not known & {*parts_of([word])} for word in words):  # fmt: skip
        return False
    text = " ".join(word for word in words if word not in (*_PLACES, *_FILLERS))
    texts = (" ".join(words), text, " ".join(parts_of(words)))
    found = (
        match[0]
        for weight, pattern in _patterns()[role]
        for match in (m for own in texts for m in pattern.finditer(own))
        if weight >= _WORD_SCORE
    )
    return any(len(w) >= _FULL or not w.isascii() for text in found for w in text.split())


def wheel_word(name: str) -> tuple[str, ...]:
    """The words of a name that say which wheel it belongs to, such as ("front", "left").

    The number of a bus or of an input is none.
    """
    words = words_of(name)
    before = ["", *words]
    return tuple(
        word for word, last in zip(words, before, strict=False)
        if word in WHEEL_WORDS and not (word.isdigit() and last in _BUSES)
    )  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """A column: its address, the unit that the log states, its behaviour and its scores by role."""

    address: str
    name: str
    unit: str
    kind: str | None
    about: Behaviour
    scores: dict[str, float]


def candidates_of(recordings: Sequence[Recording], steady: bool = False) -> list[Candidate]:
    """All numeric columns, with their scores; in a table of `steady` runs they may be constant.

    A vehicle has one speed of travel: of a left and a right side, or with numbers, as `velL` and
    `velR`, `velocity0` and `velocity1`, they are those of wheels.
    """
    counts = Counter(name for recording in recordings for name in recording.columns)
    columns = [
        _candidate(recording, name, counts[name] > 1, steady)
        for recording in recordings for name in recording.columns
    ]  # fmt: skip
    frames: dict[str, list[int]] = {}
    for i, c in enumerate(columns):
        best = max(c.scores, key=lambda role: c.scores[role], default="")
        if best == "ground_speed" and (match := _SIDE.search(c.address)):
            frames.setdefault(c.address[: match.start()], []).append(i)
    for i in (i for own in frames.values() if len(own) > 1 for i in own):
        c = columns[i]
        role = "rim_speed" if c.kind == "m/s" else "wheel_speed"
        columns[i] = replace(c, scores={role: c.scores["ground_speed"] + _UNCLEAR})
    return columns


def _candidate(recording: Recording, name: str, ambiguous: bool, steady: bool) -> Candidate:
    values = recording.columns[name]
    stated = recording.units.get(name, "")
    unit = stated if dimension(stated) else _unit_by_name(name)
    kind = dimension(unit) if unit else None
    own = behaviour(values)
    own = replace(own, constant=own.constant and not steady)
    # the name of a topic says what its fields are of: /motor/left: current
    topic = f"{recording.name} {name}" if recording.name else name
    scores = name_scores(topic)
    own_scores = name_scores(name)
    clear = max(own_scores.values(), default=0.0) >= CLEAR
    for role in {*scores, *own_scores}:
        own_score, score = own_scores.get(role, 0.0), scores.get(role, 0.0)
        if clear and not own_score:
            scores[role] = score - CLEAR  # fx of /force_torque is a force
        elif own_score >= CLEAR or role not in scores:
            scores[role] = max(own_score, score)
    topic_named = recording.name.startswith("/") or ambiguous
    address = f"{recording.name}:{name}" if topic_named and recording.name else name
    column = Candidate(address=address, name=name, unit=unit, kind=kind, about=own, scores={})
    totals = {r: _score(column, r, scores.get(r, 0.0), values) for r in (*ROLES, "time")}
    return replace(column, scores={role: total for role, total in totals.items() if total > 0.0})


def _unit_by_name(name: str) -> str:
    """The unit that ends a name; "" where it contradicts the rest, as newton does in `v_N`.

    What an analogue-digital converter gives are counts.
    """
    if "adc" in words_of(name):
        return "count"
    unit = unit_in_name(name)
    roles = name_scores(re.split(r"[_\s.\-]+", name)[0]).keys() & ROLES.keys()
    wanted = {kind for role in roles for kind in _kinds_of(role)}
    if unit == "A" and "N m" in wanted:
        return unit  # a torque in ampere is a current
    return "" if len(unit) == 1 and wanted and dimension(unit) not in wanted else unit


def _kinds_of(role: str) -> tuple[str, ...]:
    return ROLES[role][0], *_ALSO.get(role, ())


def _score(column: Candidate, role: str, score: float, values: Floats) -> float:
    """How well a column fits a role; 0 or less where it does not. `score` is that of its name."""
    own, kind = column.about, column.kind
    if own.count < 2:
        return 0.0
    if role == "time":
        if kind not in (None, "s"):
            return 0.0
        if score > 0.0 or kind == "s":
            return clock_score(values, True) * (score + (2.0 if kind == "s" else 0.0) + 1.0)
        return 0.0 if says(column.name, COUNTERS) else clock_score(values, False)
    wanted = _kinds_of(role)
    if is_raw_signal(column.unit) and role in CALIBRATED and (kind == "1" or kind not in wanted):
        kind = None  # the name decides
    if kind is not None:
        if kind not in wanted and not (kind == "1" and role == "slip"):
            return 0.0
        if kind == "1" and role == "motor_current" and score < CLEAR:
            return 0.0  # i in per cent is a slip
        if kind == "1" and role != "slip" and spelling(column.unit) != "percent":
            return 0.0
        if kind == "count" and role == "wheel_angle":
            score -= 0.5  # an angle beside it needs no counts of a turn
        score += 2.5 if kind != "1" else 2.0 if role == "slip" and score > 0.0 else 1.0
        if score <= 2.5 and (role, kind) not in _UNIT_SUFFICES:
            return 0.0
    if score <= 0.0:
        return 0.0
    if own.constant:
        score -= 3.0 if own.middle else 10.0
    monotone = own.travel > 0.6 or own.wraps_at > 0.0
    if role in ("wheel_angle", "position"):
        score += 1.5 if monotone else -2.5
        if np.unique(values[np.isfinite(values)]).size < _FEWEST_PLACES:
            score -= 4.0  # `s` of a few stages is a slip
    if role in ("wheel_speed", "ground_speed", "torque", "motor_current") and monotone:
        score -= 2.0
    if role == "load" and own.middle != 0.0:
        score += 1.0 if own.span < 1.5 * abs(own.middle) else -0.5
    if role == "drawbar_pull" and own.span < 0.3 * abs(own.middle):
        score -= 1.5  # a pull varies with slip
    if kind is None:  # of no size that the role may have
        score -= 4.0 * (role == "slip" and own.size > 150.0)
        score -= 4.0 * (role == "load" and own.size < _LEAST_LOAD)
        score -= 8.0 * (role == "sinkage" and own.span > _MOST_SINKAGE)
    return score - 3.0 * (words_of(column.name)[:1] == ["std"])


def liveliest(runs: Sequence[Run]) -> Run:
    """The run with the most columns that vary: one in which no sensor is dead."""
    return max(
        runs, key=lambda run: sum(not c.about.constant for c in candidates_of(run.recordings))
    )


def describe(columns: Sequence[Candidate], recordings: Sequence[Recording]) -> list[str]:
    """A line for each column: name, unit and range; and for those of text, which no channel is."""
    width = min(max((len(c.address) for c in columns), default=0), 44)
    lines = [
        f"{c.address:<{width}}  {c.unit or '-':<7} {c.about.low:>11.5g} .. "
        f"{c.about.high:<11.5g}" + (" constant" if c.about.constant else "")
        for c in columns
    ]
    texts = [own for recording in recordings for own in recording.texts.items()][:_MOST_TEXTS]
    for name, cells in texts:
        shown = list(dict.fromkeys(cell[:20] for cell in cells if cell))[:3]
        lines.append(f"{name[:44]}: text, such as {', '.join(map(repr, shown))}")
    return lines
