"""The words of column names that say which quantity a column is."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from soilml.optional_imports import tomllib

#: Words that say which wheel a column belongs to.
WHEEL_WORDS = (
    *("fl", "fr", "rl", "rr", "ml", "mr", "cl", "cr", "bl", "br"),
    *("lf", "rf", "lr", "lm", "rm", "lb", "rb"),
    *("left", "right", "front", "rear", "middle", "mid", "centre", "center", "back"),
    *"12345678",
)
_PLACES = ("left", "right", "front", "rear", "middle", "mid", "centre", "center", "back")
#: Words of topics and columns that say nothing of the quantity.
_FILLERS = ("state", "states", "data", "status", "sensor", "feedback", "measured", "actual", "raw")
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_WORD = re.compile(r"[^\W\d_]+|\d+")


def words_of(name: str) -> list[str]:
    """The words of a column's name in small letters: `WheelSpeed_FL` -> wheel, speed, fl."""
    return [word.lower() for word in _WORD.findall(_CAMEL.sub(" ", name))]


@cache
def _patterns() -> dict[str, list[tuple[float, re.Pattern[str]]]]:
    """Role -> weights and patterns, from the file beside this one."""
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {
        role: [(float(weight), re.compile(pattern)) for weight, pattern in entries]
        for role, entries in tomllib.loads(text).items()
    }


def name_scores(name: str) -> dict[str, float]:
    """How well a name fits each role; roles that it does not fit are left out."""
    words = words_of(name)
    # "velocity front left wheel" is a velocity of a wheel: words of the place stand between
    texts = {
        " ".join(word for word in words if word not in left_out)
        for left_out in ((), _PLACES, _FILLERS, (*_PLACES, *_FILLERS))
    }
    scores = {}
    for role, patterns in _patterns().items():
        fits = [w for w, pattern in patterns if any(pattern.search(text) for text in texts)]
        best = max([w for w in fits if w > 0], default=0.0)
        if best:
            scores[role] = best + sum(w for w in fits if w < 0)
    return scores


def wheel_word(name: str) -> tuple[str, ...]:
    """The words of a name that say which wheel it belongs to, such as ("front", "left")."""
    return tuple(word for word in words_of(name) if word in WHEEL_WORDS)
