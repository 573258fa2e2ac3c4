"""`soilml show`: soils, effects and trained files that come with the package."""

from __future__ import annotations

import argparse
import json
import re
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from soilml.cli.options import OPTIONAL
from soilml.errors import InputError, ModelFileError, did_you_mean

if TYPE_CHECKING:
    from soilml.physics.effects import Effect
    from soilml.physics.soils import SoilEntry
    from soilml.report.report import Report

FORMATS = ("table", "json")
DESCRIPTION = """\
List the published soils, the effects that [[effect]] in a model file may name,
or the released model files, whose short names stand for the files wherever a
command reads one. With a name, show one soil or effect.

  soilml show soils
  soilml show soils wong1989/dry_sand   values and their source
  soilml show effects
  soilml show effects slip-sinkage      parameters, bounds, equation, source
  soilml show models
  soilml estimate wheel                 what one model file is for

In the list of soils, * marks one of which values that are not printed in the
paper are assumed.
"""
#: What replaces commands of LaTeX, in this order; inner braces go first.
_PLAIN = (
    (r"\\(left|right)(?![a-z])|\\[;,!]|\\q?quad *", ""),
    (r"\\tfrac(\d)(\d)", r"\1/\2"),
    (r"([\^_]|sqrt)\{([^{}]*)\}", r"\1(\2)"),
    (r"\\frac\{(\w+)\}", r"\1 / "),
    (r"\\frac\{([^{}]*)\}", r"(\1) / "),
    (r"/ \{(\w+)\}", r"/ \1"),
    (r"/ \{([^{}]*)\}", r"/ (\1)"),
    (r"\\text\{([^{}]*)\}", r"\1"),
    (r"\\leftarrow", "<-"),
    (r"\\var(?=phi)", r"\\"),
    (r"(?<=[a-z\d])\\(?=[a-z])", " "),
    (r"\\", ""),
)
ARGUMENTS = (
    ("what", "soils, effects or models", {"choices": ("soils", "effects", "models")}),
    ("name", "a soil or an effect", OPTIONAL),
    "effects",
)


def run(args: argparse.Namespace) -> int:
    """Print a list, or one of its entries."""
    from soilml.cli.options import available_effects
    from soilml.cli.output import show_result
    from soilml.physics.soils import soil_catalogue

    if args.what == "models":
        if args.name is not None:
            raise InputError(f"`soilml estimate {args.name}` says what one model file is for")
        report, content = _models()
    elif args.what == "soils":
        soils = _chosen(soil_catalogue(), args.name)
        one = None if args.name is None else soils[args.name]
        report = _list_of_soils(soils.values()) if one is None else _soil(one)
        content = {name: _soil_as_json(entry) for name, entry in soils.items()}
    else:
        effects = _chosen(available_effects(args), args.name)
        report = _list_of_effects(effects) if args.name is None else _effect(effects[args.name])
        keys = ("kind", "size", "text", "source", "needs", "family", "reference")
        content = {n: {key: getattr(e.about, key) for key in keys} for n, e in effects.items()}
    show_result(report, content, details=True)
    return 0


def _chosen(catalogue: dict[str, Any], name: str | None) -> dict[str, Any]:
    """All entries, or the one of a name; `InputError` where there is none."""
    if name is None:
        return catalogue
    if name not in catalogue:
        near = did_you_mean(name, catalogue)
        raise InputError(f"there is no {name!r}; {near}there are: {', '.join(catalogue)}")
    return {name: catalogue[name]}


def _models() -> tuple[Report, dict[str, Any]]:
    """The released model files."""
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import released_models
    from soilml.optional_imports import need
    from soilml.quantities import QUANTITIES, SHEAR
    from soilml.report.report import Report
    from soilml.report.tables import ReportTable

    need("onnxruntime", "show models")
    if not released_models():
        raise ModelFileError(
            "this installation has no released model files; train one with soilml train"
        )
    content: dict[str, Any] = {}
    for name, file in released_models().items():
        estimator = Estimator.load(file)
        gear = dict(json.loads(estimator.metadata["gear"]))
        sizes = [f"{1e3 * gear[k]:.3g}" for k in ("radius", "width") if gear.get(k)]
        symbols = [QUANTITIES[n].symbol if n in SHEAR else n for n in estimator.names]
        content[name] = {
            "gear: r, w": f"{gear.get('type', '')} {', '.join(sizes) or 'of any size'}",
            "kB": file.stat().st_size // 1000,
            "set": "no" if estimator.sets is None else "yes",
            "estimates": ", ".join(symbols),
            "reads": ", ".join(estimator.inputs),
        }
    keys = next(iter(content.values()))
    columns = {key: [entry[key] for entry in content.values()] for key in keys}
    table = ReportTable.of("Models", {"name": list(content), **columns})
    notes = (
        "r, w: radius and width in mm; set: whether rows of a soil are pooled",
        "c, phi, K: cohesion, friction angle, shear modulus",
    )
    return Report("show", f"{len(content)} released model files", notes, tables=[table]), content


def _list_of_soils(entries: Iterable[SoilEntry]) -> Report:
    from soilml.report.report import Report
    from soilml.report.tables import Column, ReportTable

    soils = list(entries)
    columns = [Column("soil", [f"{s.name}{'*' if s.assumed else ''}" for s in soils])]
    for heading, field, unit in (
        ("c", "cohesion", "Pa"),
        ("phi", "friction_angle", "rad"),
        ("K", "shear_modulus", "m"),
        ("n", "n", "1"),
    ):
        columns.append(Column(heading, [float(getattr(s.soil, field)) for s in soils], unit))
    note = "* values that the paper does not print are assumed; `soilml show soils NAME` says which"
    return Report(
        "show", f"{len(soils)} published soils", [note], tables=[ReportTable("Soils", columns)]
    )


def _soil(entry: SoilEntry) -> Report:
    from soilml.parameters import declared
    from soilml.physics.soils import Soil
    from soilml.report.numbers import significant
    from soilml.report.report import Report
    from soilml.report.tables import Column, ReportTable

    parameters, notes = declared(Soil), []
    for name in parameters:
        note = "published" if name in entry.published else "default"
        if name in entry.assumed:
            note = "assumed"
        if entry.published.get(name, 0.0) < 0.0 == getattr(entry.soil, name):
            note = f"published as {entry.published[name]:g}"
        if name in entry.spread:
            low, high = map(significant, entry.spread[name])
            note = f"{low} to {high}, SI"
        notes.append(note)
    columns = [
        Column("field", list(parameters)),
        Column(
            "value",
            [float(getattr(entry.soil, name)) for name in parameters],
            [parameter.unit for parameter in parameters.values()],
        ),
        Column("from", notes),
        Column("what", [parameter.text for parameter in parameters.values()]),
    ]
    verdict = f"{entry.name}: {entry.text}"
    lines = [entry.source, "A value that is published below zero is used as zero."]
    return Report("show", verdict, lines, tables=[ReportTable("Values", columns)])


def _soil_as_json(entry: SoilEntry) -> dict[str, object]:
    from soilml.parameters import declared
    from soilml.physics.soils import Soil

    return {
        "text": entry.text,
        "source": entry.source,
        "assumed": entry.assumed,
        "values": {name: getattr(entry.soil, name) for name in declared(Soil)},
        "ranges": entry.spread,
    }


def _list_of_effects(effects: dict[str, type[Effect]]) -> Report:
    from soilml.report.report import Report
    from soilml.report.tables import ReportTable

    cards = [effect.about for effect in effects.values()]
    columns = {"effect": list(effects), "of the": [card.kind for card in cards]}
    columns |= {"size": [card.size for card in cards], "what it is": [card.text for card in cards]}
    return Report("show", f"{len(cards)} effects", tables=[ReportTable.of("Effects", columns)])


def _effect(cls: type[Effect]) -> Report:
    from soilml.parameters import declared
    from soilml.physics.effects.base import STAGES
    from soilml.physics.operating_point import COVARIATES
    from soilml.report.report import Report
    from soilml.report.tables import Column, ReportTable

    about, neutral, parameters = cls.about, cls(), declared(cls)
    units = [parameter.unit for parameter in parameters.values()]
    defaults = [float(getattr(neutral, name)) for name in parameters]
    ends = [(parameter.lower, parameter.upper) for parameter in parameters.values()]
    columns = [
        Column("parameter", list(parameters)),
        Column("default", defaults, units),
        Column.of_ranges("bounds", ends, units, defaults),
        Column("what", [parameter.text for parameter in parameters.values()]),
    ]
    acts = ", ".join(stage.removeprefix("on_") for stage in STAGES if cls.overrides(stage))
    known = {
        "of the": f"{about.kind}, acts on: {acts}",
        "needs": ", ".join(COVARIATES[field] for field in about.needs),
        "uses, where known": ", ".join(COVARIATES[field] for field in about.uses),
        "family": about.family,
        "distinguished from others by": about.isolate,
        "source": about.source,
    }
    lines = [f"{head}: {text}" for head, text in known.items() if text]
    section = ", ".join(f"{k} = {v:g}" for k, v in about.reference.items())  # in SI units
    return Report(
        "show",
        f"{cls.name}: {about.text}",
        [*lines, "", _plain(cls.__doc__ or "")],
        tables=[ReportTable("Parameters", columns)],
        next_steps=[f"in a model file: [[effect]] with name = {cls.name!r}, {section}"],
    )


def _plain(docstring: str) -> str:
    """A docstring for a terminal: without its indentation, formulas in plain characters."""
    first, *more = docstring.strip().splitlines()
    text = "\n".join([first, *[line.removeprefix("    ") for line in more]])
    return re.sub(
        r"\.\. math::\s+(.+?)(?=\n\n\S|\Z)", lambda found: _formula(found[1]), text, flags=re.S
    )


def _formula(latex: str) -> str:
    r"""A formula of LaTeX in plain characters, indented.

    >>> _formula(r"\theta \leftarrow \frac{a}{1 - e^{-b}}, \quad m = \sqrt{n}")
    '    theta <- a / (1 - e^(-b)), m = sqrt(n)'
    """
    for pattern, by in _PLAIN:
        while latex != (latex := re.sub(pattern, by, latex)):
            pass
    return textwrap.indent("\n".join(line.strip() for line in latex.splitlines()), "    ")
