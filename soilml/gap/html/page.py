"""The report as one self-contained page."""

from __future__ import annotations

import math
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from soilml.gap.html import formatting
from soilml.gap.results import STATUSES, EstimatedValue, GapReport, ReadingsAndPredictions
from soilml.optional_imports import need
from soilml.physics.effects import EFFECTS
from soilml.quantities import Z_90

if TYPE_CHECKING:
    from soilml.gap.html.plots import Shown

#: What the reader should do, by status.
_DO = {
    "no-gap": "Use the model as it is, inside the slips and loads that were driven.",
    "named": "model.toml carries the effect. Drive the first run under Next runs to confirm it.",
    "class": "Drive the first run under Next runs: it tells the explanations apart best.",
    "form-open": "model.toml carries the effect with a law that follows these data. Use it inside "
    "the slips and loads that were driven.",
    "unknown": "Read Where the model is off, then check sensors and rig or write an effect of "
    "your own.",
    "not-testable": "Drive what the sentence above says is missing, and analyse again.",
    "bad-data": "Change what is listed below, in the runs or in the model file, and run the same "
    "command again.",
}
_GROUPS = {
    "train": "Rows that were fitted",
    "held_out_runs": "Runs not fitted",
    "held_out_region": "Region not fitted",
}
#: z of the palest and of the darkest shade of the map, and those shades (red, green, blue).
_LEAST, _MOST = 1.0, 100.0
_PALE, _DARK = (255, 250, 240), (122, 28, 16)


def page(report: GapReport, model: str, runs: str) -> str:
    """The report as HTML; `model` and `runs` name the files that were analysed."""
    for library in ("jinja2", "matplotlib"):
        need(library, "gap")
    from jinja2 import Environment, StrictUndefined

    from soilml import __version__

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"figure": formatting.figure, "chance": formatting.chance}
    environment.filters |= {"channel": formatting.channel, "gain": formatting.gain}
    template = environment.from_string(
        files("soilml.gap.html").joinpath("page.html.j2").read_text(encoding="utf-8")
    )
    changed = any(s.before != s.after for s in report.gap.values())
    return template.render(
        report=report,
        sentence=_readable(report.sentence),
        model=model,
        runs=runs,
        version=__version__,
        meaning=STATUSES.get(report.status, ""),
        advice=_advice(report),
        changed=changed,
        after=_after(report),
        causes=_causes(report),
        known=_known(report),
        bars=_bars(report, changed),
        maps=_maps(report),
        curves=None if report.curves is None else _curves(report, report.curves, changed),
        soil=_soil(report),
        scatter=[formatting.scattered(k, v) for k, v in report.variance_components.items()],
        reasons=report.reasons or (report.sentence,),
        finite=math.isfinite,
    )


def _readable(sentence: str) -> str:
    """The verdict with an arrow for -> and without exponents."""
    text = sentence.replace(" -> ", " → ")
    return re.sub(r"\b\d(\.\d+)?e[+-]\d{2}\b", lambda m: formatting.figure(float(m[0])), text)


def _advice(report: GapReport) -> str:
    """What the reader should do."""
    said = _DO.get(report.status, "")
    if report.next_runs or "Next runs" not in said:
        return said
    return "Drive other slips and loads than these, and analyse all runs together."


def _after(report: GapReport) -> str:
    """What the model has after that it had not before, in words."""
    names = " + ".join(e.name for e in report.effects)
    if report.status == "class":
        return f"with {names}, standing in for the others"
    if report.status in ("named", "form-open"):
        return f"with {names}"
    return f"with {names or 'the best candidate'}, which is not claimed"


def _known(report: GapReport) -> dict[str, str]:
    """What each effect is, as far as its card is at hand."""
    cards = {e.name: e.about for e in report.model.model.effects}
    cards |= {name: e.about for name, e in EFFECTS.items() if name not in cards}
    return {name: card.text for name, card in cards.items()}


def _causes(report: GapReport) -> list[dict[str, Any]]:
    """The effects that were added, parameter by parameter."""
    declared = report.model.parameters()
    return [
        {
            "effect": e,
            "parameters": [
                (
                    k,
                    declared[f"{e.name}.{k}"][0].text if f"{e.name}.{k}" in declared else "",
                    formatting.shown(v),
                    formatting.in_si(v),
                )
                for k, v in e.parameters.items()
            ],
        }
        for e in report.effects
    ]


def _bars(report: GapReport, changed: bool) -> list[dict[str, Any]]:
    from soilml.gap.html.plots import Bar, bars

    groups = []
    for key, reduction in report.gap.items():
        pairs = {"all readings": (reduction.before, reduction.after)}
        pairs |= {formatting.channel(k): v for k, v in reduction.channels.items()}
        groups.append((key, reduction, pairs))
    values = [v for _, _, pairs in groups for pair in pairs.values() for v in pair]
    values = [v for v in values if math.isfinite(v)] or [1.0]
    found = []
    for i, (key, reduction, pairs) in enumerate(groups):
        rows = [Bar(k, b, a if changed else math.nan) for k, (b, a) in pairs.items()]
        title = _GROUPS.get(key, key.replace("_", " "))
        told = "; ".join(
            f"{k} {formatting.figure(b)}"
            + (f" before, {formatting.figure(a)} after" if changed else "")
            for k, (b, a) in pairs.items()
        )
        svg = bars(rows, max(values), min(values), f"bars{i}", f"{title}, gap: {told}")
        found.append({"title": title, "reduction": reduction, "svg": svg})
    return found


def _maps(report: GapReport) -> list[dict[str, Any]]:
    """A grid of loads by slips for each channel, the worst channel first."""
    slips = sorted({w.slip for w in report.where})
    loads = sorted({w.load_N for w in report.where}, reverse=True)
    places = {(w.channel, w.slip, w.load_N): w for w in report.where}
    grids = []
    for name in dict.fromkeys(w.channel for w in report.where):
        rows = []
        for load in loads:
            cells = []
            for slip in slips:
                w = places.get((name, slip, load))
                cells.append(None if w is None else _shade(w.z, w.p))
            rows.append((formatting.between(*load), cells))
        grids.append({"channel": formatting.channel(name), "rows": rows})
    heads = [formatting.between(*slip, digits=2) for slip in slips]
    return [grid | {"slips": heads} for grid in grids]


def _shade(z: float, p: float) -> dict[str, Any]:
    """One place of the map: its number, its colour and the colour of its text."""
    share = math.log(max(abs(z), _LEAST) / _LEAST) / math.log(_MOST / _LEAST)
    share = min(1.0, share) if math.isfinite(share) else 0.0
    shade = [round(a + share * (b - a)) for a, b in zip(_PALE, _DARK, strict=True)]
    colour = "#" + "".join(f"{part:02x}" for part in shade)
    light = sum(w * (v / 255) ** 2.2 for w, v in zip((0.2126, 0.7152, 0.0722), shade, strict=True))
    text = "#000000" if light > 0.18 else "#ffffff"  # where both contrasts are equal
    return {
        "z": abs(z),
        "p": p,
        "sure": p < 0.05,
        "side": "above" if z > 0.0 else "below",
        "colour": colour,
        "text": text,
    }


def _curves(report: GapReport, curves: ReadingsAndPredictions, changed: bool) -> dict[str, Any]:
    from soilml.gap.html.plots import chosen_runs, curve

    runs = chosen_runs(curves)
    panels = []
    for i, name in enumerate(curves.channels):
        title = (
            f"{formatting.channel(name)} over slip, measured and predicted, for {len(runs)} runs"
        )
        svg = curve(curves, i, runs, changed, f"curve{i}", title)
        panels.append(svg)
    return {
        "panels": panels,
        "runs": [_key(run) for run in runs],
        "of": len(set(curves.run)),
        "hidden": bool(curves.held_out.any()),
    }


def _key(run: Shown) -> dict[str, str]:
    """A run as the key to the curves shows it."""
    shapes = {
        "o": "M8 3a5 5 0 1 0 .01 0z",
        "s": "M3 3h10v10h-10z",
        "^": "M8 2l6 11h-12z",
        "D": "M8 1.5l6.5 6.5l-6.5 6.5l-6.5 -6.5z",
        "v": "M8 14l6 -11h-12z",
        "P": "M6 2h4v4h4v4h-4v4h-4v-4h-4v-4h4z",
    }
    load = f"{formatting.figure(run.load)}\N{NO-BREAK SPACE}N"
    return {"path": shapes[run.marker], "colour": run.colour, "run": run.run, "load": load}


def _soil(report: GapReport) -> list[dict[str, Any]]:
    """The soil parameters before and after, with what moved."""
    rows = []
    for path, old in report.soil_before.items():
        new = report.soil_after.get(path, old)
        factor, unit = formatting.handy(old.unit, max(abs(old.value), abs(new.value)))
        step, std = factor * (new.value - old.value), factor * max(new.std, old.std)
        share = 100.0 * (new.value / old.value - 1.0) if old.value else math.nan
        rows.append(
            {
                "name": formatting.parameter(path),
                "path": path,
                "unit": unit,
                "before": formatting.spread(factor * old.value, factor * old.std),
                "after": formatting.spread(factor * new.value, factor * new.std),
                "before_si": formatting.in_si(old),
                "after_si": formatting.in_si(new),
                "moved": formatting.joined(formatting.difference(step, std), unit),
                "share": f"{share:+.0f} %".replace("-", "−") if abs(share) < 1000.0 else "",
                "strip": _strip(old, new),
            }
        )
    return rows


def _strip(old: EstimatedValue, new: EstimatedValue) -> list[dict[str, str]]:
    """Where value and 90 % interval lie between the ends of a strip, in percent of its length."""
    ends = [v.value + k * Z_90 * v.std for v in (old, new) for k in (-1, 1)]
    if not all(math.isfinite(e) for e in ends) or max(ends) <= min(ends):
        return []
    low, span = min(ends), max(ends) - min(ends)

    def at(x: float) -> str:
        return f"{5.0 + 110.0 * (x - low) / span:.1f}"

    return [
        {"low": at(v.value - Z_90 * v.std), "at": at(v.value), "high": at(v.value + Z_90 * v.std)}
        for v in (old, new)
    ]
