"""The explanations that the lines of a report list: suspects with odds, and those of a class."""

from __future__ import annotations

import math
from collections.abc import Sequence

from soilml.gap.report.reasons_in_short import SENTENCE_WORDS
from soilml.gap.report.results import GapReport, NextRun, Suspect
from soilml.physics.effects import EFFECTS
from soilml.report.numbers import LEAST_STATED, decimal

SUSPECTS_IN_LINE = 3  # Suspects that a line lists
#: Logarithm of odds below which they are called even, and the largest odds that are stated.
EVEN_ODDS, MOST_ODDS = 0.1, 10_000
#: Probability of the likeliest of a class below which a line says that none of it may be the cause.
DOUBTED_CLASS = 0.5
LEFT_FOR_OTHERS = 3  # Words of a sentence that are left for how many others there are


def likelier_than_first(suspects: Sequence[Suspect]) -> list[Suspect]:
    """The suspects that are likelier than the first, which they follow for their sizes."""
    return [s for s in suspects[1:] if s.log_odds > suspects[0].log_odds]


def needed_sizes(suspect: Suspect) -> str:
    """The implausible sizes that a suspect needs, in words; empty where it needs none."""
    sizes = suspect.times_usual.items()
    return " and ".join(f"{name} at {decimal(x, 2)} times its usual size" for name, x in sizes)


def listed_explanations(report: GapReport) -> str:
    """The explanations that remain, in the order of the report; suspects with their odds.

    Suspects whose probability is only a bound stand in the table alone.
    """
    if report.status == "class":
        return _class(report)
    stated = [s for s in report.suspects if s.probability >= LEAST_STATED][:SUSPECTS_IN_LINE]
    if not stated:
        return ""
    likelier = likelier_than_first(report.suspects)
    order = "the likeliest of usual size first" if likelier else "the likeliest first"
    begin = f"Suspects, {order}, within the catalogue:"
    parts = [f"{' + '.join(s.effects)} ({_odds(s.log_odds)})" for s in stated]
    listed = "; ".join(parts[: _fitting(begin, parts)])
    why = [f" {' + '.join(s.effects)} is likelier, but needs {needed_sizes(s)}." for s in likelier]
    return f"{begin} {listed}.{''.join(why)}"


def _class(report: GapReport) -> str:
    """The explanations of a class, and whether the cause may be none of them."""
    begin = "These runs cannot distinguish, the likeliest first:"
    sets = [" + ".join(names) for names in report.cause_set]
    kept = sets[: _fitting(begin, [f"or {names}" for names in sets])]
    if left := len(sets) - len(kept):
        kept.append(f"{left} other{'s' if left > 1 else ''}")
    chance = min((e.probability for e in report.effects), default=1.0)
    doubted = chance < DOUBTED_CLASS or _are_sensor_faults(report.cause_set[0])
    outside = " A cause outside the catalogue is possible." if doubted else ""
    return f"{begin} {', or '.join(kept)}.{outside}"


def _fitting(begin: str, parts: Sequence[str]) -> int:
    """How many parts after `begin` one sentence holds: one at least."""
    words, count = len(begin.split()), 0
    for part in parts:
        words += len(part.split())
        if count and words > SENTENCE_WORDS - LEFT_FOR_OTHERS:
            break
        count += 1
    return count


def _are_sensor_faults(names: Sequence[str]) -> bool:
    """Whether all of these effects are faults of sensors."""
    return all(name in EFFECTS and EFFECTS[name].about.kind == "sensor" for name in names)


def _odds(log_odds: float) -> str:
    """Odds against all other explanations, in words."""
    if abs(log_odds) < EVEN_ODDS:
        return "even odds"
    if abs(log_odds) > math.log(MOST_ODDS):
        number = f"more than {MOST_ODDS}"
    else:
        number = decimal(math.exp(abs(log_odds)), 2)
    return f"odds {number} to 1" if log_odds >= 0.0 else f"odds 1 to {number}"


def next_run_in_words(run: NextRun) -> str:
    """The first of the next runs, which explanations it separates, and by how much."""
    sigma = "10 or more" if run.discrimination >= 10.0 else decimal(run.discrimination, 2)
    cost = "" if run.cost is None else f" at a cost of {run.cost:g}"
    first, *rivals = [" + ".join(names) or "the soil alone" for names in run.compared]
    against = rivals[0]
    if len(rivals) > 1:
        against += f" and {len(rivals) - 1} other{'s' if len(rivals) > 2 else ''}"
        sigma += " sigma on average"
    else:
        sigma += " sigma"
    what = f"separates {first} from {against} by {sigma}{cost}."
    begin = f"Next: {run.kind} ({run.text})"
    one = f"{begin}, which {what}"
    return one if len(one.split()) <= SENTENCE_WORDS else f"{begin}. This {what}"
