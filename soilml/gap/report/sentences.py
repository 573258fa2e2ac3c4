"""The verdict of a gap report in words, and the conclusions that it does not support.

The headline and the lines below it are what all outputs say: terminal, page, JSON and live page.
They name no runs; those stand in the reasons, the notes and the tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from soilml.fitting.misfit import excess_residuals
from soilml.gap.report.listed_explanations import (
    likelier_than_first,
    listed_explanations,
    next_run_in_words,
)
from soilml.gap.report.reasons_in_short import in_sentences, short_reason
from soilml.gap.report.results import (
    GapReport,
    NoiseAgreement,
    RemainingDiscrepancy,
    Suspect,
)
from soilml.remarks import Remark
from soilml.report.numbers import (
    channel_name,
    decimal,
    format_probability,
    format_residual,
    shown_unit,
)

#: Why nothing is named where the evidence for the suspects is weak.
NOT_DECISIVE = Remark("not-decisive", "the evidence is not decisive beside the model's usual error")
HEADLINE_WORDS, MOST_LINES = 25, 5  # Words of a headline, and lines below it, at most
UNLIKELY_SUSPECT = 0.1  # Probability of the first suspect below which the headline doubts it
HARDLY = 0.95  # Share of a gap that is left, above which it hardly shrinks
LIKE_NOISE = 1.3  # Mean squared residual below which a gap is no matter of its size
NOTABLE_DISCREPANCY = 0.3  # Discrepancy in sigma from which a line states it

#: What a headline says of residuals beyond the declared noise without a smooth gap, by the reason.
_BEYOND_NOISE = {
    "excess-residuals": "; these rows cannot tell a gap from understated noise",
    "soil-at-prior": (
        ", with the soil at ends of its priors: widen them, or model or noise is wrong"
    ),
}


def headline(report: GapReport) -> str:
    """The verdict in at most `HEADLINE_WORDS` words.

    It says whether there is a gap, the first effect, by how much the gap shrinks, and how sure that
    is.
    """
    match report.status:
        case "bad-data":
            return _faults(report)
        case "no-gap":
            return _no_gap(report)
        case "undecided":
            code = report.reasons[0].code if report.reasons else ""
            if (found := report.misfit) and code in _BEYOND_NOISE:
                size = excess_residuals(math.sqrt(found.declared), found.with_discrepancy)
                return f"R{size[1:]}{_BEYOND_NOISE[code]}."
            why = "; ".join(map(short_reason, report.reasons[:1]))
            return f"No smooth gap was found, but the measurements disagree: {why}."
        case "not-testable":
            why = "; ".join(map(short_reason, report.reasons[:1]))
            return f"There is a gap, but these runs cannot identify its cause: {why}."
        case "unknown":
            faults = [r for r in report.reasons if r.code == "implausible-fault"]
            which = " that no effect explains better than a smooth error"
            if faults:
                which = f", which only an implausibly large {' + '.join(faults[0].about)} explains"
            sure = f"probability {format_probability(report.gap_probability)}"
            size = f"mean squared residual {_before(report)}; noise alone gives 1"
            if "train" in report.gap and report.gap["train"].before < LIKE_NOISE:
                size = "residuals form a pattern that noise does not"
            return f"There is a gap{which} ({size}; {sure})."
        case "suspected":
            first = report.suspects[0] if report.suspects else None
            names = " + ".join(report.best_unclaimed or (first.effects if first else ()))
            sure = f" ({_probability(first)})" if first else ""
            return f"Cause not certain: {_first(report)} {names}{sure}{_shrinks(report)}."
    names = " + ".join(e.name for e in report.effects)
    sure = _sure(report)
    if report.status == "class":
        return _one_of_several(report, names, sure)
    if report.status == "partly-named":
        return f"Missing effect, among others: {names}{sure}{_shrinks(report)}."
    law = ", by another law than the catalogue's" if report.status == "form-open" else ""
    return f"Missing effect: {names}{law}{sure}{_shrinks(report)}."


def _one_of_several(report: GapReport, names: str, sure: str) -> str:
    """The first of a class, with what is likelier still and may act beside any of them."""
    count, end = len(report.cause_set), _shrinks(report)
    chance = min((e.probability for e in report.effects), default=1.0)
    if chance < UNLIKELY_SUSPECT:
        return f"No effect is likely; the first of {count} explanations is {names}{sure}{end}."
    begin = f"Missing effect: one of {count} explanations, likeliest {names}{sure}"
    first = report.suspects[0] if report.suspects else None
    parts = {name for own in report.cause_set for name in own}
    if first and first.probability > chance and not parts & set(first.effects):
        longer = f"{begin}, maybe beside {' + '.join(first.effects)} ({_number(first)}){end}."
        if len(longer.split()) <= HEADLINE_WORDS:
            return longer
    return f"{begin}{end}."


def _first(report: GapReport) -> str:
    """How the first suspect is introduced."""
    if not report.suspects:
        return "first suspect is"
    if likelier_than_first(report.suspects):
        return "first suspect of usual size is"
    first = report.suspects[0]
    likely = first.probability >= UNLIKELY_SUSPECT or first.times_usual
    return "first suspect is" if likely else "no effect is likely, the first is"


def _probability(suspect: Suspect) -> str:
    size = ", implausibly large" if suspect.times_usual else ""
    return f"probability {_number(suspect)}{size}"


def _number(suspect: Suspect) -> str:
    return format_probability(suspect.probability)


def _faults(report: GapReport) -> str:
    """The first fault, if it can be said shortly, and how many there are."""
    count = len(report.reasons)
    more = f"; {count - 1} more fault{'s' if count > 2 else ''}" if count > 1 else ""
    text = report.reasons[0].text + more
    if len(text.split()) <= HEADLINE_WORDS:
        return text
    return f"{count} fault{'s' if count > 1 else ''} in the data or the model file."


def _no_gap(report: GapReport) -> str:
    declared = " and the declared discrepancy" if report.model.discrepancy else ""
    beside = " and declared discrepancy" if report.model.discrepancy else ""
    p = f"probability of a gap {format_probability(report.gap_probability)}."
    if report.misfit is None or not report.misfit.grants_scatter:
        residual = format_residual(report.gap["train"].before, 2)
        return (
            f"Model and measurements agree within the noise{declared}: mean squared residual "
            f"{residual}, {p}"
        )
    return f"No gap beyond noise{beside}, with {_scatter(report.misfit)}: {p}"


def _scatter(found: NoiseAgreement) -> str:
    """The scatter that the soil is granted, with its size."""
    angle = math.degrees(found.friction_angle_std)
    parts = [f"{decimal(angle, 2)} deg"] if angle > 0.0 else []
    parts += [f"{100.0 * found.bearing_std:.2g} %"] if found.bearing_std > 0.0 else []
    return f"a scatter of {' and '.join(parts)} from run to run"


def _sure(report: GapReport) -> str:
    chance = min((e.probability for e in report.effects), default=math.nan)
    return f" (probability {format_probability(chance)})" if math.isfinite(chance) else ""


def _before(report: GapReport) -> str:
    return format_residual(report.gap["train"].before) if "train" in report.gap else "unknown"


def _shrinks(report: GapReport) -> str:
    """By how much the gap shrinks, as the end of a sentence."""
    if "train" not in report.gap:
        return ""
    before, after = report.gap["train"].before, report.gap["train"].after
    if not report.gap["train"].shrinks:
        return f"; the gap stays at {format_residual(before)}"
    hardly = "hardly " if after > HARDLY * before else ""
    return f"; the gap {hardly}shrinks {format_residual(before)} -> {format_residual(after)}"


def report_lines(report: GapReport, model_effects: Sequence[str] = ()) -> tuple[Remark, ...]:
    """At most `MOST_LINES` lines: what was tried, what is left and where, what to drive next.

    model_effects: Names of the effects that the model had before the analysis.
    """
    if report.status == "bad-data":
        return ()
    lines = [_tried(report, model_effects)]
    if report.status in ("suspected", "unknown", "not-testable", "undecided"):
        why = report.reasons or ((NOT_DECISIVE,) if report.status == "suspected" else ())
        text = in_sentences("Why no cause is named", [short_reason(reason) for reason in why])
        lines += [Remark("why", text)] if why else []
    if report.status in ("suspected", "class") and (listed := listed_explanations(report)):
        lines.append(Remark("suspects", listed))
    if left := _remainder(report):
        lines.append(Remark("left", left))
    lines += [
        Remark(note.code, f"{note.text[:1].upper()}{note.text[1:]}.", note.about, note.severity)
        for note in report.notes
        if note.code in ("hidden-effect", "outliers-matter")
    ]
    if report.next_runs:
        lines.append(Remark("next", next_run_in_words(report.next_runs[0])))
    if len(lines) > MOST_LINES:  # the headline and the notes have figures of what was tried
        del lines[0]
    return tuple(lines[: MOST_LINES - 1] + lines[MOST_LINES - 1 :][-1:])


def _tried(report: GapReport, model_effects: Sequence[str]) -> Remark:
    """What was tried, and how large the residuals are under the declared noise and with scatter."""
    sentences, parts = [], []
    if count := sum(len(note.about) for note in report.notes if note.code == "outliers"):
        sentences.append(f"{outliers_in_words(count)} excluded")
    if found := report.misfit:
        size = excess_residuals(math.sqrt(found.declared), found.with_discrepancy)
        text = f"{size} by the soil alone"
        if found.grants_scatter and found.granted <= found.declared:
            text += f", {math.sqrt(found.granted):.1f} times with {_scatter(found)}"
        without = f"without {'it' if count == 1 else 'them'}, " if count else ""
        sentences.append(f"{without}{text}")
    count = len(report.candidates)
    if count:
        parts.append(f"{count} explanation{'s were' if count > 1 else ' was'} fitted")
    if report.untestable:
        parts.append(f"{len(report.untestable)} effects cannot be tested by these runs")
    parts += [
        f"the model has {e.name} at another size" for e in report.effects if e.name in model_effects
    ]
    sentences += ["; ".join(parts)] if parts else []
    sentences = sentences or ["the soil alone was fitted"]
    return Remark("tried", " ".join(f"{text[:1].upper()}{text[1:]}." for text in sentences))


def outliers_in_words(count: int) -> str:
    """So many outliers, as the subject of a sentence in the passive."""
    return (
        "1 reading is an outlier and was"
        if count == 1
        else f"{count} readings are outliers and were"
    )


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
    beside = " + ".join(names) or "the soil alone"
    parts = [f"{_size(n, d)} ({decimal(d.after_sigma, 2)} sigma)" for n, d in left.items()]
    text = f"A smooth discrepancy is left beside {beside}."
    text += f" Its root mean square: {', '.join(parts)}."
    worst, largest = max(left.items(), key=lambda item: item[1].after_sigma)
    if where := largest.description:
        text += f" {channel_name(worst).capitalize()} is {where}."
    return f"{text} {cause}".rstrip()


def _size(name: str, discrepancy: RemainingDiscrepancy) -> str:
    """A discrepancy with the name of its channel; lengths in mm."""
    channel = name.rpartition("_")[0].replace("_", " ")
    factor, unit = shown_unit(discrepancy.unit)
    return f"{channel} {decimal(factor * discrepancy.after_value, 2)} {unit}"


#: What a status does not support, as the code and the text of a remark.
_NOT_SUPPORTED_BY = {
    "named": [
        (
            "outside-catalogue",
            "that no cause outside the catalogue has the same signature as the named effect",
        )
    ],
    "class": [
        (
            "which-effect",
            "which of the effects is present; model.toml contains the one that fits best",
        )
    ],
    "unknown": [("cause", "any cause: model.toml contains the refitted soil and no new effect")],
    "suspected": [
        (
            "cause",
            "any cause: model.toml predicts by a mixture of the explanations",
        )
    ],
}
_NOT_SUPPORTED_BY |= {
    "partly-named": [
        *_NOT_SUPPORTED_BY["named"],
        ("remaining-discrepancy", "the cause of the remaining discrepancy"),
    ],
    "form-open": [
        *_NOT_SUPPORTED_BY["named"],
        (
            "law",
            "the law of the effect: slip_power, by_slip and by_load describe these data "
            "empirically",
        ),
    ],
}


def unsupported_conclusions(
    report: GapReport, naming_obstacles: Sequence[Remark], fixed: Sequence[str]
) -> list[Remark]:
    """Conclusions that the report does not support; `fixed` names parameters that were fixed."""
    found = [
        replace(obstacle, text=f"the cause of the gap: {obstacle}") for obstacle in naming_obstacles
    ]
    if report.status in ("no-gap", "undecided"):
        text = "that the model is complete: these runs merely show no disagreement"
        return [*found, Remark("model-complete", text)]
    found += [Remark(code, text) for code, text in _NOT_SUPPORTED_BY.get(report.status, [])]
    if fixed:
        text = (
            f"that {', '.join(fixed)} in the model file are correct: they were fixed. An error in "
            "them appears as an effect: free them with a prior or with --free"
        )
        found.append(Remark("fixed-parameters", text, tuple(fixed)))
    text = "that a smaller gap proves a cause: wrong effects reduce the gap too"
    found.append(Remark("smaller-gap", text))
    if "held_out_region" in report.gap:
        region = report.gap["held_out_region"]
        if region.after > 0.5 * region.before and region.before > 1.5:
            text = f"extrapolation: on {region.description} the gap is hardly reduced"
            found.append(Remark("extrapolation", text))
    return found
