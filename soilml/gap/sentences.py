"""The verdict of a gap report in words: the headline, and the lines below it.

They are what all outputs say: terminal, page, JSON and live page. They name no runs; those stand in
the reasons, the notes and the tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from string import Formatter

from soilml.fitting.misfit import excess_residuals
from soilml.gap.results import GapReport, NextRun, NoiseAgreement
from soilml.gap.statuses import STATUSES
from soilml.quantities import COLUMNS
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

#: Why nothing is named where the evidence for the suspects is weak.
NOT_DECISIVE = Remark("not-decisive", "the evidence is not decisive beside the model's usual error")
HEADLINE_WORDS, MOST_LINES = 25, 5  # Words of a headline, and lines below it, at most
REASON_WORDS = 12  # Words of a reason without a name that stands in a headline or line, at most
SENTENCE_WORDS = 30  # Words of a sentence, at most
LEFT_FOR_OTHERS = 3  # Words of a sentence that are left for how many others there are
SUSPECTS_IN_LINE = 3  # Suspects that a line lists
HARDLY = 0.95  # Share of a gap that is left, above which it hardly shrinks
LIKE_NOISE = 1.3  # Mean squared residual below which a gap is no matter of its size
NOTABLE_DISCREPANCY = 0.3  # Discrepancy in sigma from which a line states it
NOTABLE_OUTSIDE = 0.05  # Probability of a cause outside the catalogue from which a line states it

#: What a headline says of residuals beyond the declared noise without a smooth gap, by the reason.
_BEYOND_NOISE = {
    "excess-residuals": "; these rows cannot tell a gap from understated noise",
    "soil-at-prior": (
        ", with the soil at ends of its priors: widen them, or model or noise is wrong"
    ),
}
#: Reasons in a few words, by their codes; the report lists them in full. Effects of the explanation
#: that a reason is about take the place of the braces.
_IN_SHORT = {
    "noise-scaled": "readings scatter more than their noise",
    "runs-differ": "runs differ like different soils",
    "region-not-predicted": "one region is not predicted by the other rows",
    "soil-test": "rows and tests of the soil disagree",
    "excess-residuals": "residuals exceed the declared noise",
    "soil-at-prior": "the soil is at ends of its priors",
    "not-decisive": "the evidence is not decisive",
    "soil-outside-priors": "a soil outside its priors explains the rows",
    "prior-opened": "the priors of the soil were opened",
    "few-readings": "there are few readings",
    "one-run": "there is one run only",
    "one-load": "there is one load only",
    "few-slips": "there are too few slips",
    "implausible-fault": "{} would be an implausibly large fault",
    "unchecked-fault": "{} is a fault that nothing has checked",
    "implausible-size": "{} would have to be implausibly large",
    "not-predictive": "beside a smooth remainder, {} predicts rows kept back no better than the "
    "soil alone",
    "other-law": "the law of {} differs from the catalogue's",
    "not-catalogued": "a large discrepancy{channel} is left beside {}",
}


def short_reason(reason: Remark) -> str:
    """A reason in a few words, with the effects of the explanation that it is about."""
    text = _IN_SHORT.get(reason.code, reason.text)
    if "{}" in text:
        names = " + ".join(n for n in reason.about if n not in COLUMNS) or "the best fit"
        channels = [f" of {channel_name(n)}" for n in reason.about if n in COLUMNS]
        return text.format(names, channel="".join(channels))
    return text if len(text.split()) <= REASON_WORDS else "see the reasons"


def headline(report: GapReport) -> str:
    """The verdict in at most `HEADLINE_WORDS` words, by the template of its status.

    It says whether there is a gap, the first effect, by how much the gap shrinks, and how sure that
    is.
    """
    template = STATUSES[report.status].headline
    used = {name for _, name, _, _ in Formatter().parse(template) if name}
    return template.format(**{name: _WORDS[name](report) for name in used})


def _names(report: GapReport) -> str:
    """The effects that are claimed, else the first suspect."""
    if report.effects:
        return " + ".join(e.name for e in report.effects)
    first = report.best_unclaimed or (report.suspects[0].effects if report.suspects else ())
    return " + ".join(first)


def _sure(report: GapReport) -> str:
    """The probability of what is named, as the middle of a sentence."""
    chances = [e.probability for e in report.effects]
    large = ""
    if not chances and report.suspects:
        chances = [report.suspects[0].probability]
        large = ", implausibly large" if report.suspects[0].times_usual else ""
    return f" (probability {format_probability(min(chances))}{large})" if chances else ""


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


def _why(report: GapReport) -> str:
    return "; ".join(map(short_reason, report.reasons[:1]))


def _which(report: GapReport) -> str:
    """Which gap an unknown one is."""
    faults = [r for r in report.reasons if r.code == "implausible-fault"]
    if faults:
        return f", which only an implausibly large {' + '.join(faults[0].about)} explains"
    return " that no effect explains better than a smooth error"


def _size(report: GapReport) -> str:
    train = report.gap.get("train")
    if train is not None and train.before < LIKE_NOISE:
        return "residuals form a pattern that noise does not"
    before = "unknown" if train is None else format_residual(train.before)
    return f"mean squared residual {before}; noise alone gives 1"


def _disagreement(report: GapReport) -> str:
    code = report.reasons[0].code if report.reasons else ""
    if (found := report.misfit) and code in _BEYOND_NOISE:
        return f"{capitalised(_excess(found))}{_BEYOND_NOISE[code]}."
    return f"No smooth gap was found, but the measurements disagree: {_why(report)}."


def _faults(report: GapReport) -> str:
    """The first fault, if it can be said shortly, and how many there are."""
    count = len(report.reasons)
    more = f"; {count - 1} more fault{'s' if count > 2 else ''}" if count > 1 else ""
    text = report.reasons[0].text + more
    if len(text.split()) <= HEADLINE_WORDS:
        return text
    return f"{count} fault{'s' if count > 1 else ''} in the data or the model file."


def _agreement(report: GapReport) -> str:
    declared = any(not one.learned for one in report.model.discrepancy.values())
    if report.misfit is not None:
        declared = report.misfit.with_discrepancy
    p = f"probability of a gap {format_probability(report.gap_probability)}."
    if report.misfit is not None and report.misfit.grants_scatter:
        beside = " and declared discrepancy" if declared else ""
        return f"No gap beyond noise{beside}, with {_scatter(report.misfit)}: {p}"
    beside = " and the declared discrepancy" if declared else ""
    residual = format_residual(report.gap["train"].before, 2)
    return (
        f"Model and measurements agree within the noise{beside}: mean squared residual "
        f"{residual}, {p}"
    )


#: What stands in the templates of `STATUSES`.
_WORDS = {
    "names": _names,
    "sure": _sure,
    "shrinks": _shrinks,
    "why": _why,
    "which": _which,
    "size": _size,
    "count": lambda report: len(report.cause_set),
    "gap": lambda report: format_probability(report.gap_probability),
    "disagreement": _disagreement,
    "faults": _faults,
    "agreement": _agreement,
}


def _excess(found: NoiseAgreement) -> str:
    return excess_residuals(math.sqrt(found.declared), found.with_discrepancy)


def _scatter(found: NoiseAgreement) -> str:
    """The scatter that the soil is granted, with its size."""
    angle = math.degrees(found.friction_angle_std)
    parts = [f"{decimal(angle, 2)} deg"] if angle > 0.0 else []
    parts += [f"{100.0 * found.bearing_std:.2g} %"] if found.bearing_std > 0.0 else []
    return f"a scatter of {' and '.join(parts)} from run to run"


def needed_sizes(times_usual: dict[str, float]) -> str:
    """Implausible sizes that an explanation needs, in words; empty where it needs none."""
    sizes = times_usual.items()
    return " and ".join(f"{name} at {decimal(x, 2)} times its usual size" for name, x in sizes)


def listed_explanations(report: GapReport) -> str:
    """The explanations that remain, the likeliest first, and whether the cause may be none of them.

    Suspects have their probabilities; one whose probability is only a bound stands in the table
    alone.
    """
    if report.status not in ("suspected", "class", "unknown"):
        return ""
    if report.status == "class":
        begin = "These runs cannot distinguish, the likeliest first:"
        sets = [" + ".join(names) for names in report.cause_set]
        kept = sets[: _fitting(begin, [f"or {names}" for names in sets])]
        if left := len(sets) - len(kept):
            kept.append(f"{left} other{'s' if left > 1 else ''}")
        said = f"{begin} {', or '.join(kept)}."
    elif report.status == "suspected":
        stated = [s for s in report.suspects if s.probability >= LEAST_STATED][:SUSPECTS_IN_LINE]
        if not stated:
            return ""
        begin = "Suspects, the likeliest first, with their probabilities:"
        parts = [f"{' + '.join(s.effects)} ({decimal(s.probability, 2)})" for s in stated]
        said = f"{begin} {'; '.join(parts[: _fitting(begin, parts)])}."
        if needed := needed_sizes(stated[0].times_usual):
            said += f" The first needs {needed}."
    else:
        said = ""
    if (outside := report.outside_probability) >= NOTABLE_OUTSIDE:
        said += f" Probability that the catalogue lacks the cause: {decimal(outside, 2)}."
    return said.strip()


def _fitting(begin: str, parts: Sequence[str]) -> int:
    """How many parts after `begin` one sentence holds: one at least."""
    words, count = len(begin.split()), 0
    for part in parts:
        words += len(part.split())
        if count and words > SENTENCE_WORDS - LEFT_FOR_OTHERS:
            break
        count += 1
    return count


def next_run_in_words(run: NextRun) -> str:
    """The first of the next runs, which explanations it separates, and by how much."""
    sigma = "10 or more" if run.discrimination >= 10.0 else decimal(run.discrimination, 2)
    first, *rivals = [" + ".join(names) or "the soil alone" for names in run.compared]
    against, average = rivals[0], ""
    if len(rivals) > 1:
        against += f" and {len(rivals) - 1} other{'s' if len(rivals) > 2 else ''}"
        average = " on average"
    what = f"separates {first} from {against} by {sigma} sigma{average}."
    begin = f"Next: {run.kind} ({run.text})"
    one = f"{begin}, which {what}"
    return one if len(one.split()) <= SENTENCE_WORDS else f"{begin}. This {what}"


def report_lines(report: GapReport, model_effects: Sequence[str] = ()) -> tuple[Remark, ...]:
    """At most `MOST_LINES` lines: what was tried, what is left and where, what to drive next.

    model_effects: Names of the effects that the model had before the analysis.
    """
    if report.status == "bad-data":
        return ()
    lines = [_tried(report, model_effects)]
    if report.status in ("suspected", "unknown", "not-testable", "undecided"):
        why = report.reasons or ((NOT_DECISIVE,) if report.status == "suspected" else ())
        text = _in_sentences("Why no cause is named", [short_reason(reason) for reason in why])
        lines += [Remark("why", text)] if why else []
    if listed := listed_explanations(report):
        lines.append(Remark("suspects", listed))
    if left := _remainder(report):
        lines.append(Remark("left", left))
    hidden = [note for note in report.notes if note.code == "hidden-effect"]
    lines += [replace(note, text=f"{capitalised(note.text)}.") for note in hidden]
    if report.next_runs:
        lines.append(Remark("next", next_run_in_words(report.next_runs[0])))
    if len(lines) > MOST_LINES:  # the headline and the notes have figures of what was tried
        del lines[0]
    return tuple(lines[: MOST_LINES - 1] + lines[MOST_LINES - 1 :][-1:])


def _in_sentences(begin: str, parts: Sequence[str]) -> str:
    """Parts after `begin`, in sentences of at most `SENTENCE_WORDS` words where each has fewer."""
    sentences = [f"{begin}:"]
    for i, part in enumerate(dict.fromkeys(parts)):
        longer = f"{sentences[-1]}{';' if i else ''} {part}"
        if i and len(longer.split()) > SENTENCE_WORDS:
            sentences.append(capitalised(part))
        else:
            sentences[-1] = longer
    return f"{'. '.join(sentences)}."


def _tried(report: GapReport, model_effects: Sequence[str]) -> Remark:
    """What was tried, and how large the residuals are under the declared noise and with scatter."""
    sentences, parts = [], []
    if count := sum(len(note.about) for note in report.notes if note.code == "outliers"):
        sentences.append(f"{outliers_in_words(count)} excluded")
    if found := report.misfit:
        text = f"{_excess(found)} by the soil alone"
        if found.grants_scatter and found.granted <= found.declared:
            text += f", {math.sqrt(found.granted):.1f} times with {_scatter(found)}"
        without = f"without {'it' if count == 1 else 'them'}, " if count else ""
        sentences.append(f"{without}{text}")
    if report.untestable:
        parts.append(f"{len(report.untestable)} effects cannot be tested by these runs")
    parts += [
        f"the model has {e.name} at another size" for e in report.effects if e.name in model_effects
    ]
    sentences += ["; ".join(parts)] if parts else []
    sentences = sentences or ["the soil alone was fitted"]
    return Remark("tried", " ".join(f"{capitalised(text)}." for text in sentences))


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
    names = tuple(e.name for e in report.effects)
    if report.status == "suspected":
        names = report.best_unclaimed
    parts = []
    for name, own in left.items():
        factor, unit = shown_unit(own.unit)
        size = f"{channel_name(name)} {decimal(factor * own.after_value, 2)} {unit}"
        parts.append(f"{size} ({decimal(own.after_sigma, 2)} sigma)")
    text = f"A smooth discrepancy is left beside {' + '.join(names) or 'the soil alone'}."
    text += f" Its root mean square: {', '.join(parts)}."
    worst, largest = max(left.items(), key=lambda item: item[1].after_sigma)
    if where := largest.description:
        text += f" {capitalised(channel_name(worst))} is {where}."
    return f"{text} {cause}".rstrip()
