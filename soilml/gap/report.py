"""What a gap analysis says, as one report, and the files that are written of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from soilml.gap.pictures import bars_picture, map_picture, remainder_picture
from soilml.gap.results import GapReport
from soilml.gap.statuses import STATUSES
from soilml.io.text_tables import csv_text
from soilml.remarks import texts
from soilml.report.numbers import channel_name
from soilml.report.page import Provenance, json_text, page, report_entry
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

#: Statuses whose advice is to make the first of the next runs.
_ADVISES_NEXT_RUN = ("suspected", "partly-named", "named", "class")
_LISTED = 6  # Explanations that are listed
#: Names of the parts of the rows, by those of the figures in gap.json.
PARTS = {
    "train": "fitted rows",
    "held_out_runs": "held-out runs",
    "held_out_region": "held-out region",
    "held_out_slips": "held-out slips",
}


def gap_report(found: GapReport, title: str = "Gap between model and measurements") -> Report:
    """The report of a gap analysis: verdict, readings beside the model, where, how large, what."""
    untested = [f"{name}: {why.text}" for name, why in found.untestable.items()]
    details: list[tuple[str, Sequence[str]]] = [
        ("Why no cause is certain", texts(found.reasons)),
        ("What these runs do not support", texts(found.not_claimed)),
        ("Effects that these runs cannot test", untested),
    ]
    status = STATUSES[found.status]
    step = status.advice
    if found.status in _ADVISES_NEXT_RUN and not found.next_runs:
        step = "Make runs at other slips and loads, and analyse all runs together."
    return Report(
        kind="gap",
        verdict=found.sentence,
        lines=texts(found.lines),
        figures=_parameters(found),
        tables=[*_tables(found)],
        pictures=[*_pictures(found)],
        remarks=found.notes,
        next_steps=[step],
        details=[entry for entry in details if entry[1]],
        status=found.status,
        tone=status.tone,
        title=title,
        basis=f"{status.meaning}; seed {found.seed}",
    )


def shown_model(found: GapReport) -> str:
    """The model whose figures are shown beside those of the soil alone, in words."""
    names = " + ".join(e.name for e in found.effects)
    if found.status == "class":
        return f"with {names}, the likeliest of {len(found.cause_set)} explanations"
    if names:
        return f"with {names}"
    return f"with {' + '.join(found.first) or 'the best candidate'}, which is not claimed"


def _parameters(found: GapReport) -> ReportTable | None:
    """Soil and added effects, with the soil alone beside them where that differs."""
    columns = found.frame_columns()
    if not columns["parameter"]:
        return None
    if found.soil_before == found.soil_after:
        return ReportTable.of_parameters("Soil and effects", columns)
    alone = Column(
        "soil alone",
        columns["mean_before"],
        columns["unit"],
        columns["std_before"],
        sizes=columns["mean"],
    )
    note = f"The soil {shown_model(found)}; 'soil alone' is biased where an effect is missing."
    if not found.first:
        note = "The soil beside a smooth discrepancy of unknown cause, and alone."
    return ReportTable.of_parameters("Soil and effects", columns, note, **{"soil alone": alone})


def _tables(found: GapReport) -> Iterator[ReportTable]:
    if found.suspects:
        yield _suspects(found)
    if found.gap:
        yield _sizes(found)
    if any(d.after_sigma > 0.0 for d in found.discrepancy.values()):
        yield _discrepancy(found)
    if found.next_runs:
        yield _next_runs(found)
    if entries := found.variance_components:
        size = ["rad" if name == "friction_angle_std" else "1" for name in entries]
        yield ReportTable(
            "Estimated variation",
            [
                Column("quantity", [name.replace("_", " ") for name in entries]),
                Column("size", list(entries.values()), size, digits=2),
            ],
            "It is part of the noise throughout this report.",
        )


def _suspects(found: GapReport) -> ReportTable:
    """The likeliest explanations, those that are claimed first."""
    shown = found.suspects[:_LISTED]
    columns = [
        Column("effects", [" + ".join(s.effects) for s in shown]),
        Column("probability", [s.probability for s in shown], digits=2),
    ]
    note = (
        f"Probability of a gap {found.gap_probability:.2f}, of a cause outside the catalogue "
        f"{found.outside_probability:.2f}."
    )
    return ReportTable("Explanations", columns, note)


def _sizes(found: GapReport) -> ReportTable:
    """Mean squared residuals by part of the rows and channel, before and after."""
    rows = [
        (PARTS.get(key, key), name, before, after if part.shrinks else np.nan, part)
        for key, part in found.gap.items()
        for name, (before, after) in (
            ("all readings", (part.before, part.after)),
            *((channel_name(n), pair) for n, pair in part.channels.items()),
        )
    ]
    where, channel, before, after, parts = map(list, zip(*rows, strict=True))
    columns = [
        Column("rows", where),
        Column("channel", channel),
        Column("soil alone", before, digits=3),
    ]
    if not np.isnan(after).all():
        columns.append(Column("after", after, digits=3))
    columns.append(Column("readings", [part.readings for part in parts]))
    columns.append(Column("what", [part.description for part in parts]))
    note = "Mean squared residual in sigma; noise alone gives 1. Blank: not smaller after."
    return ReportTable("Figures of the gap", columns, note)


def _discrepancy(found: GapReport) -> ReportTable:
    left = found.discrepancy
    cause = ""
    if found.remainder_cause is not None:
        chance = found.remainder_cause.probability
        cause = f" {found.remainder_cause.remark().text} Probability of this stage: {chance:.2f}."
    return ReportTable(
        "Remaining disagreement",
        [
            Column("channel", [channel_name(name) for name in left]),
            Column("root mean square", [d.after_value for d in left.values()],
                   [d.unit for d in left.values()], digits=3),
            Column("sigma", [d.after_sigma for d in left.values()], digits=2),
            Column("where it is largest", [d.description for d in left.values()]),
        ],
        f"Smooth discrepancy that is left, with a probability of {found.remainder_probability:.2f}."
        f"{cause}",
    )  # fmt: skip


def _next_runs(found: GapReport) -> ReportTable:
    runs = found.next_runs
    sigma = [run.discrimination for run in runs]
    columns = [Column("kind", [run.kind for run in runs]), Column("sigma", sigma, digits=3)]
    columns.append(Column("what to do", [run.text for run in runs]))
    first, *others = [" + ".join(names) or "the soil alone" for names in runs[0].compared or [()]]
    apart = f" of {first} from {', '.join(others)}" if others else ""
    note = f"Expected discrimination{apart}, at most 10 stated; above 3 sigma a run decides."
    return ReportTable("Next runs", columns, note)


def _pictures(found: GapReport) -> Iterator[Picture]:
    if found.curves is not None:
        yield found.curves.picture(shown_model(found))
    if found.where:
        yield map_picture(found)
    if found.gap:
        yield bars_picture(found, PARTS)
    if found.model.remainder is not None:
        yield remainder_picture(found.model.remainder)


def gap_files(
    found: GapReport, model_name: str, runs_name: str, origin: Provenance | None = None
) -> dict[str, str]:
    """The content of a report's files by their names.

    model_name, runs_name: Names of the analysed files.
    """
    from soilml.config.write_case import case_as_toml

    if origin is None:
        origin = Provenance.of(["gap", model_name, runs_name], [])
    report = gap_report(found, f"Gap report: {model_name} against {runs_name}")
    comments = [found.sentence]
    if count := len(found.model.explanations):
        which = "One explanation follows" if count == 1 else f"{count} explanations follow"
        comments += [f"{which}, with weights; every prediction mixes them."]
    return {
        "report.html": page(report, origin),
        "gap.json": json_text(found.as_json() | {"report": report_entry(report, origin)}),
        "model.toml": case_as_toml(found.model, comments),
        "next_runs.csv": csv_text(_planned_runs(found)),
    }


def _planned_runs(found: GapReport) -> dict[str, list[Any]]:
    """The suggested runs, one line for each operating point; a sensor check has one line."""
    lines: list[dict[str, Any]] = []
    for number, option in enumerate(found.next_runs, 1):
        head: dict[str, Any] = {"run": f"next_{number}", "kind": option.kind, "what": option.text}
        head["separates_sigma"] = option.discrimination
        lines += [head | row for row in option.rows or [{}]]
    names = ["run", "kind", "what", "separates_sigma"]
    names += ["slip", "load_N"]
    names += [name for line in lines for name in line if name not in names]
    return {name: [line.get(name, "") for line in lines] for name in dict.fromkeys(names)}
