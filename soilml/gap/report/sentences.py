"""The verdict of a gap report in words, and the conclusions that it does not support."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from soilml.gap.report.results import GapReduction, GapReport, RemainingDiscrepancy
from soilml.remarks import Remark, texts
from soilml.report.numbers import decimal, format_residual

#: Why nothing is named where the evidence for the suspects is weak.
NOT_DECISIVE = Remark("not-decisive", "the evidence is not decisive beside the model's usual error")
LISTED_SUSPECTS = 3  # Suspects that the sentence lists
#: Logarithm of odds below which they are called even, and the largest odds that are stated.
EVEN_ODDS, MOST_ODDS = 0.1, 10_000
NOTABLE_DISCREPANCY = 0.3  # Discrepancy in sigma from which the sentence states it


def verdict_sentence(report: GapReport, model_effects: Sequence[str]) -> str:
    """The verdict in words.

    model_effects: Names of the effects that the model had before the analysis.
    """
    names = " + ".join(
        f"{e.name} (the model has it at another size)" if e.name in model_effects else e.name
        for e in report.effects
    )
    reduction = _reduction(report.gap["train"])
    match report.status:
        case "no-gap":
            declared = " and the declared discrepancy" if report.model.discrepancy else ""
            return (
                f"Model and measurements agree within the noise{declared}: mean squared residual "
                f"{format_residual(report.gap['train'].before, 2)}, p = {decimal(report.p_gap, 2)}."
            )
        case "undecided":
            return (
                "No smooth disagreement between model and measurements was found, but the "
                f"measurements are inconsistent: {'; '.join(texts(report.reasons))}."
            )
        case "not-testable":
            why = "; ".join(texts(report.reasons))
            return f"There is a gap, but these runs cannot identify its cause: {why}."
        case "suspected":
            return _suspected(report)
        case "unknown" if report.reasons:
            best = " + ".join(report.best_unclaimed)
            return (
                f"There is a gap, and no cause is named: {best} fits best, but "
                f"{'; '.join(texts(report.reasons))}. {_remainder(report)}"
            ).strip()
        case "unknown":
            return (
                "There is a gap, and no effect of the catalogue explains it better than a smooth "
                f"discrepancy of unknown cause does. {_remainder(report)}"
            ).strip()
        case "class":
            sets = ", or ".join(" + ".join(names) for names in report.cause_set)
            return (
                f"Each of these may explain the gap, the likeliest first: {sets}. With the first, "
                f"{reduction}. These runs cannot distinguish them. {_remainder(report)}"
            ).strip()
        case "partly-named":
            return f"The evidence supports {names}: {reduction}. {_remainder(report)}".strip()
        case "form-open":
            return (
                f"The gap is explained by {names}, with a law that differs from the catalogue's: "
                f"{reduction}."
            )
    return (
        f"The gap is explained by {names}: {reduction}. No other effect of the catalogue "
        "explains it."
    )


def _reduction(figures: GapReduction) -> str:
    """The gap before and after, and why it grows where it does."""
    before, after = format_residual(figures.before), format_residual(figures.after)
    grows = "; it grows because the fit leaves a smooth discrepancy, which is not subtracted"
    return (
        f"mean squared residual {before} -> {after} "
        f"(noise alone gives 1{grows if figures.after > figures.before else ''})"
    )


def _suspected(report: GapReport) -> str:
    """The ranked suspects with their odds, and why none of them is named."""
    listed = "; ".join(
        f"{' + '.join(s.effects)} ({_odds(s.log_odds)})" for s in report.suspects[:LISTED_SUSPECTS]
    )
    why = "; ".join(texts(report.reasons or (NOT_DECISIVE,)))
    first = " + ".join(report.best_unclaimed or report.suspects[0].effects)
    return (
        f"There is a gap, and its cause is not named: {why}. Suspects, the likeliest first, with "
        f"their odds within the catalogue: {listed}. With {first}, "
        f"{_reduction(report.gap['train'])}."
    )


def _odds(log_odds: float) -> str:
    """Odds against all other explanations, in words."""
    if abs(log_odds) < EVEN_ODDS:
        return "even odds"
    if abs(log_odds) > math.log(MOST_ODDS):
        number = f"more than {MOST_ODDS}"
    else:
        number = decimal(math.exp(abs(log_odds)), 2)
    return f"odds {number} to 1" if log_odds >= 0.0 else f"odds 1 to {number}"


def _remainder(report: GapReport) -> str:
    """The remaining discrepancy of each channel, in the reading's unit and in sigma."""
    parts = [
        f"{_size(name, d)} ({decimal(d.after_sigma, 2)} sigma)"
        for name, d in report.discrepancy.items()
        if d.after_sigma >= NOTABLE_DISCREPANCY
    ]
    return f"A smooth discrepancy is left, root mean square: {', '.join(parts)}." if parts else ""


def _size(name: str, discrepancy: RemainingDiscrepancy) -> str:
    """A discrepancy with the name of its channel; lengths in mm."""
    channel = name.rpartition("_")[0].replace("_", " ")
    if discrepancy.unit == "m":
        return f"{channel} {decimal(1e3 * discrepancy.after_value, 2)} mm"
    return f"{channel} {decimal(discrepancy.after_value, 2)} {discrepancy.unit}"


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
            "any cause: model.toml contains the refitted soil and no new effect; "
            "model_suspected.toml contains the first suspect",
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
            f"that {', '.join(fixed)} in the model file are correct: they were fixed, and an error "
            "in them appears as an effect; free them with a prior or with --free"
        )
        found.append(Remark("fixed-parameters", text, tuple(fixed)))
    text = "that a smaller gap proves a cause: wrong effects reduce the gap too"
    found.append(Remark("smaller-gap", text))
    if "held_out_region" in report.gap:
        region = report.gap["held_out_region"]
        if region.after > 0.5 * region.before and region.before > 1.5:
            text = f"extrapolation: on {region.description} the gap is hardly reduced"
            found.append(Remark("extrapolation", text))
    return found + [
        replace(report.untestable[name], text=f"{name}: {report.untestable[name]}")
        for name in sorted(report.untestable)
    ]
