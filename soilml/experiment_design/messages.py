"""What rows have told and what not, and what to drive next, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.experiment_design.design import Advice, RatedRow
from soilml.quantities import NOT_IDENTIFIED_ABOVE

Floats = NDArray[np.float64]

#: Differences of width, in shares of the prior's, that are not worth a word.
NEGLIGIBLE = 0.02


def is_identified(left: Floats) -> NDArray[np.bool_]:
    """Whether rows told a parameter, by the width that they leave of its prior.

    Above `NOT_IDENTIFIED_ABOVE` the answer is mostly the prior: abstain.
    """
    return np.asarray(left <= NOT_IDENTIFIED_ABOVE)


def abstention_message(name: str, left: float, what: str = "these rows do") -> str:
    """That a parameter was not told; `what` names the rows: these rows do, this row does."""
    name = name.replace("_", " ")
    return f"{name}: {left:.0%} of the prior's width remains: {what} not tell it"


def next_row_messages(advice: Advice, what: str = "these rows do") -> list[str]:
    """A line for each parameter that was not told, and one of the row that helps most in all.

    `what` as for `abstention_message`.
    """
    said = [
        f"{abstention_message(name, left, what)}. {_helps(advice, name)}"
        for name, left, ok in zip(advice.names, advice.now, is_identified(advice.now), strict=True)
        if not ok
    ]
    return [*said, f"next row that helps most in all: {row_message(advice, advice.best())}"]


def row_message(advice: Advice, choice: RatedRow) -> str:
    """A row, and what it is expected to leave of each prior."""
    pairs = zip(advice.names, choice.left, strict=True)
    shares = ", ".join(f"{name.replace('_', ' ')} {left:.0%}" for name, left in pairs)
    return f"{choice.candidate.said} (expected to leave {shares})"


def _helps(advice: Advice, name: str) -> str:
    """The row that tells most of one parameter, against repeating what was driven."""
    i = advice.names.index(name)
    best = advice.best(name)
    left = float(best.left[i])
    if left > advice.now[i] - NEGLIGIBLE:
        return f"No single row would: {_together(advice, i)}"
    text = f"Most helpful next: {best.candidate.said} (leaves {left:.0%})"
    others = [(own, float(advice.best(name, own).left[i])) for own in advice.sets[1:]]
    better = [(own, share) for own, share in others if share < left - NEGLIGIBLE]
    if better:
        own, share = min(better, key=lambda pair: pair[1])
        text += f", with {own[1].replace('_', ' ')} {share:.0%}"
    repeat = advice.repeat(name)
    if repeat is not None:
        text += f"; repeating what was driven leaves {repeat.left[i]:.0%}"
    return text if is_identified(np.asarray(left)) else f"{text}; {_together(advice, i)}"


def _together(advice: Advice, i: int) -> str:
    """What several rows leave of parameter `i`."""
    if len(advice.sequence) < 2:
        return "several rows at other slips and loads may"
    rows = ", then ".join(c.candidate.said for c in advice.sequence)
    count = len(advice.sequence)
    return f"{count} rows together leave {advice.sequence[-1].left[i]:.0%}: {rows}"


def as_json(advice: Advice, choice: RatedRow) -> dict[str, object]:
    """A row to drive, and the width that it is expected to leave of each prior."""
    c = choice.candidate
    return {
        "slip": c.slip,
        "load_N": c.load,
        "channels": list(c.channels),
        "left_of_prior": dict(zip(advice.names, choice.left.tolist(), strict=True)),
    }


def summary(advice: Advice) -> dict[str, object]:
    """The best next rows: in all, for each parameter, and the best repetition."""
    repeat = advice.repeat()
    return {
        "next": as_json(advice, advice.best()),
        "next_for": {name: as_json(advice, advice.best(name)) for name in advice.names},
        "repeat": None if repeat is None else as_json(advice, repeat),
    }
