"""The report as one self-contained HTML page.

Each section is a template `section_NAME.html.j2`, which `gap_page.html.j2` includes. What it needs
besides the report, `_content` builds by functions of this module and of those for the figures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from soilml.gap.checks import MIN_RESIDUAL_READINGS, NAMING_RESIDUAL_READINGS
from soilml.gap.report.gap_figure import gap_bars
from soilml.gap.report.listed_explanations import likelier_than_first, needed_sizes
from soilml.gap.report.prediction_curves import prediction_curves
from soilml.gap.report.results import STATUSES, GapReport
from soilml.optional_imports import need
from soilml.physics.effects import EFFECTS
from soilml.quantities import Z_90
from soilml.remarks import Remark, texts
from soilml.report import numbers
from soilml.report.numbers import (
    channel_name,
    display_unit,
    format_change,
    format_estimate,
    format_in_si,
    format_probability,
    format_range,
    format_with_std,
    parameter_name,
    with_unit,
)
from soilml.report.page import Provenance, Report, render
from soilml.results import EstimatedValue


def page(
    report: GapReport, model_name: str, runs_name: str, origin: Provenance | None = None
) -> str:
    """The report as HTML.

    model_name, runs_name: Names of the analysed files.
    origin: The command and its files; by default the call of `soilml.gap.gap` in Python.
    """
    for library in ("jinja2", "matplotlib"):
        need(library, "gap")
    if origin is None:
        origin = Provenance.of(["gap", model_name, runs_name], [])
    content = {"page": summary(report, model_name, runs_name), "origin": origin, **_content(report)}
    return render("gap_page.html.j2", "soilml.gap.report", "gap", **content)


def summary(report: GapReport, model_name: str, runs_name: str) -> Report:
    """What every report says: question, verdict, warnings, what to do."""
    notation = []
    if report.gap:
        notation = [
            (
                "Gap",
                "mean of ((measured − predicted) / σ)², where σ is the standard deviation of the "
                "reading from sensor noise and run-to-run variation; noise alone gives 1. A "
                "prediction without equilibrium counts as 10 σ off.",
            ),
            (
                "Held out",
                "both models are refitted without the runs, or the region, that they then predict, "
                "unless rows were held out by --holdout.",
            ),
            ("σ, ±", "one standard deviation."),
        ]
    return Report(
        kind="gap",
        title=f"Gap report: {model_name} against {runs_name}",
        badge=report.status,
        meaning=STATUSES.get(report.status, ""),
        answer=said(report),
        tone=report.status,
        warnings=report.notes,
        next_steps=[text] if (text := advice(report)) else [],
        notation=notation,
    )


def said(report: GapReport) -> list[str]:
    """The headline and the lines below it, as pages show them."""
    return [text.replace(" -> ", " → ") for text in (report.sentence, *texts(report.lines))]


def _content(report: GapReport) -> dict[str, Any]:
    """The variables of the templates, section by section."""
    changed = any(s.shrinks for s in report.gap.values())
    components = report.variance_components.items()
    return {
        "report": report,
        "finite": math.isfinite,
        "changed": changed,
        "reasons": report.reasons,
        "least_readings": MIN_RESIDUAL_READINGS,
        "naming_readings": NAMING_RESIDUAL_READINGS,
        "shown_model": shown_model(report),
        "known": effect_descriptions(report),
        "bars": gap_bars(report, changed),
        "causes": effect_tables(report),
        "maps": discrepancy_maps(report),
        "curves": report.curves and prediction_curves(report.curves, changed),
        "soil": soil_table(report),
        "soil_tests": soil_test_table(report),
        "effects_after": effects_after(report),
        "soil_changed": report.soil_before != report.soil_after,
        "suspects": suspect_table(report),
        "by_size": bool(likelier_than_first(report.suspects)),
        "given": conditions_text(report.conditions),
        "variance_components": [
            numbers.format_variance_component(key, value) for key, value in components
        ],
    }


#: What the reader should do, by status.
_ADVICE = {
    "no-gap": "Use the model as it is, within the measured range of slip and load.",
    "undecided": "Do not use the model as it is yet: find out why the measurements disagree, then "
    "correct the noise in the model file or the runs, and analyse again.",
    "suspected": "Make the first run under Next runs. model.toml contains the first suspect, "
    "marked as such, where it predicts rows kept back better; else the soil alone.",
    "partly-named": "model.toml contains the effect and, under [discrepancy], the size of what is "
    "left, which widens every interval computed from it.{learned} Make the first run under Next "
    "runs.",
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


#: Statuses whose advice is to make the first of the next runs.
_ADVISES_NEXT_RUN = ("suspected", "partly-named", "named", "class")


def advice(report: GapReport) -> str:
    """What the reader should do."""
    if report.status in _ADVISES_NEXT_RUN and not report.next_runs:
        return "Make runs at other slips and loads, and analyse all runs together."
    learned = ""
    if report.model.remainder is not None:
        learned = " Under [remainder] it contains what is left, as it was learned."
    return _ADVICE.get(report.status, "").format(learned=learned)


def shown_model(report: GapReport) -> str:
    """The model whose figures are shown beside those of the soil alone, in words."""
    names = " + ".join(e.name for e in report.effects)
    if report.status == "class":
        count = len(report.cause_set)
        return f"with {names}, the likeliest of {count} explanations that the data do not reject"
    if report.status in ("named", "form-open", "partly-named"):
        return f"with {names}"
    return f"with {' + '.join(report.best_unclaimed) or 'the best candidate'}, which is not claimed"


def effects_after(report: GapReport) -> str:
    """The effects beside which the soil after was fitted; empty where it is the soil alone."""
    if report.effects:
        return " + ".join(e.name for e in report.effects)
    written = any(note.code == "suspect-predicts" for note in report.notes)
    return " + ".join(report.best_unclaimed) if written else ""


def effect_descriptions(report: GapReport) -> dict[str, str]:
    """One-line descriptions of effects by name, from the model and the catalogue."""
    case = report.model
    models = (case.model, *case.gears.values())
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


def conditions_text(conditions: Sequence[Remark]) -> str:
    """The conditions under which the odds of suspects are valid, as the rest of a sentence."""
    return "if " + ", and if ".join(texts(conditions)) if conditions else ""


def suspect_table(report: GapReport) -> list[dict[str, Any]]:
    """The suspects with their probabilities, where no single cause is named."""
    if report.status not in _WITH_SUSPECTS:
        return []
    return [
        {
            "effects": s.effects,
            "needs": needed_sizes(s),
            "log_odds": s.log_odds,
            "probability": format_probability(s.probability),
            "prediction": s.prediction,
        }
        for s in report.suspects[:_LISTED]
    ]


def soil_table(report: GapReport) -> list[dict[str, Any]]:
    """One row for each soil parameter."""
    rows = []
    for path, old in report.soil_before.items():
        new = report.soil_after.get(path, old)
        factor, unit = display_unit(old.unit, max(abs(old.value), abs(new.value)))
        step, std = factor * (new.value - old.value), factor * max(new.std, old.std)
        percent = 100.0 * (new.value / old.value - 1.0) if old.value else math.nan
        rows.append(
            {
                "name": parameter_name(path),
                "path": path,
                "unit": unit,
                "before": format_with_std(factor * old.value, factor * old.std),
                "after": format_with_std(factor * new.value, factor * new.std),
                "before_si": format_in_si(old),
                "after_si": format_in_si(new),
                "moved": with_unit(format_change(step, std), unit),
                "share": f"{percent:+.0f} %".replace("-", "−") if abs(percent) < 1000.0 else "",
                "strip": _strip(old, new),
            }
        )
    return rows


def soil_test_table(report: GapReport) -> list[dict[str, str]]:
    """One row for each plate or shear test that the model file has."""
    rows = []
    for test in report.soil_tests:
        factor, unit = display_unit(test.unit, test.measured)
        rows.append(
            {
                "name": test.label,
                "unit": unit,
                "measured": f"{factor * test.measured:.3g}",
                "before": f"{factor * test.before:.3g}",
                "after": f"{factor * test.after:.3g}",
                "sigma_before": f"{test.sigma_before:+.1f} σ".replace("-", "−"),
                "sigma_after": f"{test.sigma_after:+.1f} σ".replace("-", "−"),
            }
        )
    return rows


def _strip(old: EstimatedValue, new: EstimatedValue) -> list[dict[str, str]]:
    """Positions of value and 90 % interval on a strip 120 wide with margins of 5."""
    ends = [v.value + k * Z_90 * v.std for v in (old, new) for k in (-1, 1)]
    if not all(math.isfinite(e) for e in ends) or max(ends) <= min(ends):
        return []
    low, span = min(ends), max(ends) - min(ends)

    def position(x: float) -> str:
        return f"{5.0 + 110.0 * (x - low) / span:.1f}"

    return [
        {
            "low": position(v.value - Z_90 * v.std),
            "at": position(v.value),
            "high": position(v.value + Z_90 * v.std),
        }
        for v in (old, new)
    ]


#: Scores of the lightest and of the darkest shade, and those shades (red, green, blue).
_LOWEST, _HIGHEST = 1.0, 100.0
_LIGHT, _DARK = (255, 250, 240), (122, 28, 16)
_SIGNIFICANT = 0.05  # Family-wise p value below which a region is marked


def discrepancy_maps(report: GapReport) -> list[dict[str, Any]]:
    """The map of each channel, the channel with the largest score first."""
    slips = sorted({w.slip for w in report.where})
    loads = sorted({w.load_N for w in report.where}, reverse=True)
    regions = {(w.channel, w.slip, w.load_N): w for w in report.where}
    heads = [format_range(*slip, digits=2) for slip in slips]
    maps = []
    for name in dict.fromkeys(w.channel for w in report.where):
        rows = []
        for load in loads:
            entries = []
            for slip in slips:
                w = regions.get((name, slip, load))
                entries.append(None if w is None else _entry(w.z, w.p))
            rows.append((format_range(*load), entries))
        maps.append({"channel": channel_name(name), "rows": rows, "slips": heads})
    return maps


def _entry(z: float, p: float) -> dict[str, Any]:
    """One region: its score, its colour and the colour of its text."""
    share = math.log(max(abs(z), _LOWEST) / _LOWEST) / math.log(_HIGHEST / _LOWEST)
    share = min(1.0, share) if math.isfinite(share) else 0.0
    shade = [round(a + share * (b - a)) for a, b in zip(_LIGHT, _DARK, strict=True)]
    # relative luminance (WCAG 2); black and white text have equal contrast at 0.18
    weights = (0.2126, 0.7152, 0.0722)
    luminance = sum(w * (v / 255) ** 2.2 for w, v in zip(weights, shade, strict=True))
    return {
        "z": abs(z),
        "p": p,
        "sure": p < _SIGNIFICANT,
        "side": "above" if z > 0.0 else "below",
        "colour": "#" + "".join(f"{part:02x}" for part in shade),
        "text": "#000000" if luminance > 0.18 else "#ffffff",
    }
