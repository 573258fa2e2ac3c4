"""The verdict of a gap report in words: the headline, and the lines below it.

They are what all outputs say: terminal, page, JSON and live page. They name no runs; those stand in
the reasons, the notes and the tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from string import Formatter

from soilml.gap.results import GapReport, NextRun
from soilml.gap.statuses import STATUSES
from soilml.remarks import Remark
from soilml.report.numbers import (
    LEAST_STATED,
    capitalised,
    channel_name,
    decimal,
    format_probability,
    format_residual,
    shown_unit,
)

HEADLINE_WORDS = 25  # Words of a headline, at most
LISTED = 3  # Suspects, members of a class and reasons that a line lists
HARDLY = 0.95  # Share of a gap that is left, above which it hardly shrinks
LIKE_NOISE = 1.3  # Mean squared residual below which a gap is no matter of its size
NOTABLE_DISCREPANCY = 0.3  # Discrepancy in sigma from which a line states it
NOTABLE_OUTSIDE = 0.05  # Probability of a cause outside the catalogue from which a line states it


def short_reason(reason: Remark) -> str:
    """What stands before the colon of a reason; the report lists all of it."""
    return reason.text.partition(": ")[0]


def headline(report: GapReport) -> str:
    """The verdict in at most `HEADLINE_WORDS` words, by the template of its status.

    It says whether there is a gap, the first effect, by how much the gap shrinks, and how sure that
    is.
    """
    template = STATUSES[report.status].headline
    used = {name for _, name, _, _ in Formatter().parse(template) if name}
    return template.format(**{name: _WORDS[name](report) for name in used})


def _sure(report: GapReport) -> str:
    """The probability of what is named, as the middle of a sentence."""
    chances = [e.probability for e in report.effects]
    chances = chances or [s.probability for s in report.suspects[:1]]
    return f" (probability {format_probability(min(chances))})" if chances else ""


def _shrinks(report: GapReport) -> str:
    """By how much the gap shrinks, as the end of a sentence."""
    if "train" not in report.gap:
        return ""
    own = report.gap["train"]
    before, after = format_residual(own.before), format_residual(own.after)
    if not own.shrinks:
        return f"; the gap stays at {before}"
    hardly = "hardly " if own.after > HARDLY * own.before else ""
    return f"; the gap {hardly}shrinks {before} -> {after}"


def _size(report: GapReport) -> str:
    """How large an unknown gap is, or that residuals as small as the noise form a pattern."""
    before = report.gap["train"].before
    if before < LIKE_NOISE:
        return "residuals form a pattern that noise does not"
    return f"mean squared residual {format_residual(before)}; noise alone gives 1"


def _faults(report: GapReport) -> str:
    """The first fault, if it can be said shortly, and how many there are."""
    count = len(report.reasons)
    more = f"; {count - 1} more fault{'s' if count > 2 else ''}" if count > 1 else ""
    text = report.reasons[0].text + more
    if len(text.split()) <= HEADLINE_WORDS:
        return text
    return f"{count} fault{'s' if count > 1 else ''} in the data or the model file."


def _noise(report: GapReport) -> str:
    """What counts as noise: that of the sensors, a declared discrepancy, and scatter."""
    declared = any(not one.learned for one in report.model.discrepancy.values())
    parts = ["noise", *(["declared discrepancy"] if declared else [])]
    found = report.variance_components
    angle = math.degrees(found.get("friction_angle_std", 0.0))
    if angle > 0.0:
        parts.append(f"{decimal(angle, 2)} deg of scatter between runs")
    *others, last = parts
    return f"{', '.join(others)} and {last}" if others else last


#: What stands in the templates of `STATUSES`.
_WORDS = {
    "names": lambda report: " + ".join(report.first),
    "sure": _sure,
    "shrinks": _shrinks,
    "why": lambda report: "; ".join(map(short_reason, report.reasons[:1])),
    "count": lambda report: len(report.cause_set),
    "gap": lambda report: format_probability(report.gap_probability),
    "residual": lambda report: format_residual(report.gap["train"].before),
    "size": _size,
    "faults": _faults,
    "noise": _noise,
}


def listed_explanations(report: GapReport) -> str:
    """The explanations that remain, the likeliest first, and whether the cause may be none of them.

    Suspects have their probabilities; one whose probability is only a bound stands in the table
    alone.
    """
    said, status = "", report.status
    if status == "class":
        sets = [" + ".join(names) for names in report.cause_set]
        if (left := len(sets) - LISTED) > 0:
            sets[LISTED:] = [f"{left} other{'s' if left > 1 else ''}"]
        said = f"These runs cannot distinguish, the likeliest first: {', or '.join(sets)}."
    elif status == "suspected":
        stated = [s for s in report.suspects if s.probability >= LEAST_STATED][:LISTED]
        parts = [f"{' + '.join(s.effects)} ({decimal(s.probability, 2)})" for s in stated]
        if not stated:
            return ""
        said = f"Suspects, the likeliest first, with their probabilities: {'; '.join(parts)}."
    elif status != "unknown":
        return ""
    if (outside := report.outside_probability) >= NOTABLE_OUTSIDE:
        said += f" Probability that the catalogue lacks the cause: {decimal(outside, 2)}."
    return said.strip()


def next_run_in_words(run: NextRun) -> str:
    """The first of the next runs, which explanations it separates, and by how much."""
    sigma = "10 or more" if run.discrimination >= 10.0 else decimal(run.discrimination, 2)
    first, *rivals = [" + ".join(names) or "the soil alone" for names in run.compared]
    more = f" and {len(rivals) - 1} other{'s' if len(rivals) > 2 else ''}"
    against = rivals[0] + (more if len(rivals) > 1 else "")
    return f"Next: {run.kind} ({run.text}). It separates {first} from {against} by {sigma} sigma."


def report_lines(report: GapReport, model_effects: Sequence[str] = ()) -> tuple[Remark, ...]:
    """At most five lines: what was tried, what is left and where, what to drive next.

    model_effects: Names of the effects that the model had before the analysis.
    """
    if report.status == "bad-data":
        return ()
    why = "; ".join(map(short_reason, report.reasons[:LISTED]))
    said = {
        "tried": _tried(report, model_effects),
        "why": f"Why no cause is named: {why}." if why else "",
        "suspects": listed_explanations(report),
        "left": _remainder(report),
        "next": next_run_in_words(report.next_runs[0]) if report.next_runs else "",
    }
    return tuple(Remark(code, text) for code, text in said.items() if text)


def _tried(report: GapReport, model_effects: Sequence[str]) -> str:
    """What was tried, and how large the residuals are under the declared noise."""
    parts = []
    if count := sum(len(note.about) for note in report.notes if note.code == "outliers"):
        parts.append(f"{outliers_in_words(count)} excluded")
    if report.misfit is not None:
        size = f"{math.sqrt(report.misfit):.1f} times the declared noise"
        parts.append(f"residuals are {size} by the soil alone")
    if report.untestable:
        parts.append(f"{len(report.untestable)} effects cannot be tested by these runs")
    present = [e.name for e in report.effects if e.name in model_effects]
    parts += [f"the model has {name} at another size" for name in present]
    return " ".join(f"{capitalised(text)}." for text in parts or ["the soil alone was fitted"])


def outliers_in_words(count: int) -> str:
    """So many outliers, as the subject of a sentence in the passive."""
    one = "1 reading is an outlier and was"
    return one if count == 1 else f"{count} readings are outliers and were"


def _remainder(report: GapReport) -> str:
    """The remaining discrepancy of each channel, beside what it is left, where, and its cause.

    That of a suspected cause is the discrepancy beside the first suspect, but the cause of a
    remainder is told of what is left beside an explanation that is claimed, or the soil alone.
    """
    cause = report.remainder_cause.remark().text if report.remainder_cause is not None else ""
    left = {n: d for n, d in report.discrepancy.items() if d.after_sigma >= NOTABLE_DISCREPANCY}
    if not left:
        return cause
    parts = []
    for name, own in left.items():
        factor, unit = shown_unit(own.unit)
        size = f"{channel_name(name)} {decimal(factor * own.after_value, 2)} {unit}"
        parts.append(f"{size} ({decimal(own.after_sigma, 2)} sigma)")
    beside = " + ".join(report.first) if report.cause_set else ""
    text = f"A smooth discrepancy is left beside {beside or 'the soil alone'}."
    text += f" Its root mean square: {', '.join(parts)}."
    worst, largest = max(left.items(), key=lambda item: item[1].after_sigma)
    if where := largest.description:
        text += f" {capitalised(channel_name(worst))} is {where}."
    return f"{text} {cause}".rstrip()
