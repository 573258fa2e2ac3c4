"""The head of the page: advice by status, and the effects that were added."""

from __future__ import annotations

import math
from typing import Any

from soilml.gap.results import GapReport
from soilml.physics.effects import EFFECTS
from soilml.report.numbers import format_estimate, format_in_si, format_probability

#: What the reader should do, by status.
_ADVICE = {
    "no-gap": "Use the model as it is, within the measured range of slip and load.",
    "undecided": "Do not use the model as it is yet: find out why the measurements disagree, then "
    "correct the noise in the model file or the runs, and analyse again.",
    "suspected": "Make the first run under Next runs. model.toml contains the soil alone, with its "
    "discrepancy; model_suspected.toml contains the first suspect.",
    "partly-named": "model.toml contains the effect and, under [discrepancy], the size of what is "
    "left, which widens every interval computed from it. Make the first run under Next runs.",
    "named": "model.toml contains the effect. Make the first run under Next runs to confirm it.",
    "class": "Make the first run under Next runs: it discriminates best between the explanations.",
    "form-open": "model.toml contains the effect with a law fitted to these data. Use it within "
    "the measured range of slip and load.",
    "unknown": "Read the section Where the model disagrees, then check the sensors and the rig, or "
    "define an effect of your own.",
    "not-testable": "Add the runs that the sentence above asks for, and analyse again.",
    "bad-data": "Correct the runs or the model file as listed below, and run the same command "
    "again.",
}


def advice(report: GapReport) -> str:
    """What the reader should do."""
    text = _ADVICE.get(report.status, "")
    if report.next_runs or "Next runs" not in text:
        return text
    return "Make runs at other slips and loads, and analyse all runs together."


def model_after(report: GapReport) -> str:
    """Description of the model after the analysis."""
    names = " + ".join(e.name for e in report.effects)
    if report.status == "class":
        return f"with {names}, one of the equally good explanations"
    if report.status in ("named", "form-open", "partly-named"):
        return f"with {names}"
    return f"with {' + '.join(report.best_unclaimed) or 'the best candidate'}, which is not claimed"


def effect_descriptions(report: GapReport) -> dict[str, str]:
    """One-line descriptions of effects by name, from the model and the catalogue."""
    models = (report.model.model, *report.model.gears.values())
    cards = {e.name: e.about for model in models for e in model.effects}
    cards |= {name: e.about for name, e in EFFECTS.items() if name not in cards}
    return {name: card.text for name, card in cards.items()}


def effect_tables(report: GapReport) -> list[dict[str, Any]]:
    """The parameters of the effects that were added."""
    declared = report.model.parameters()
    return [
        {
            "effect": e,
            "probability": format_probability(e.probability),
            "parameters": [
                (
                    k,
                    declared[f"{e.name}.{k}"][0].text if f"{e.name}.{k}" in declared else "",
                    format_estimate(v),
                    format_in_si(v),
                )
                for k, v in e.parameters.items()
            ],
        }
        for e in report.effects
    ]


#: Suspects that are listed, and statuses under which the list is shown: a named cause is not one of
#: several suspects.
_LISTED, _WITH_SUSPECTS = 6, ("suspected", "unknown", "class", "not-testable")


def suspect_table(report: GapReport) -> list[dict[str, Any]]:
    """The suspects with their probabilities, where no single cause is named."""
    if report.status not in _WITH_SUSPECTS:
        return []
    return [
        {
            "effects": s.effects,
            "given": s.given,
            "log_odds": s.log_odds,
            "probability": format_probability(1.0 / (1.0 + math.exp(-s.log_odds))),
        }
        for s in report.suspects[:_LISTED]
    ]
