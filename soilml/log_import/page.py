"""What an import says: rows, what was left out and why, what looks odd, and shared errors."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from soilml.log_import.figures import draw_run, panels_over_slip, plot_rows, run_panels
from soilml.remarks import Remark
from soilml.report.numbers import format_quantity
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

if TYPE_CHECKING:
    from soilml.log_import.result import ImportedLog

#: Most runs of which the page has a picture; the others are in the tables.
MOST_RUNS = 24
_SHOWN = ("run", "time_s", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
_UNITS = {"slip": "1", "load": "N", "torque": "N m", "drawbar_pull": "N", "sinkage": "m"}


def report_of_import(found: ImportedLog) -> Report:
    """The report of an import."""
    rows, runs = len(found.table), found.runs
    odd = (*found.implausible, *found.remarks)
    if found.implausible:
        verdict, tone = f"The map looks wrong: {odd[0].text}", "bad"
        step = "correct the map, and import again"
    elif odd:
        verdict, tone = odd[0].text, "warn"
        step = "look at the remarks and the pictures; then identify the soil from the rows"
    else:
        verdict, tone = f"{rows} rows were imported, and nothing looks odd.", "good"
        step = "identify the soil from the rows: soilml identify, or soilml gap"
    basis = "each row of the table is a steady run"
    if found.series:
        basis = f"{_kept_share(found)} of the time is in steady windows"
    return Report(
        kind="import",
        verdict=verdict,
        tables=[*_tables(found)],
        pictures=[*_pictures(found)],
        remarks=odd[1:],
        next_steps=[step],
        details=[("[bias] for the model file", [found.bias_toml()])],
        status=f"{rows} row{'s'[: rows != 1]}",
        tone=tone,
        title=f"Import report: {found.map_name}",
        basis=f"{runs} run{'s'[: runs != 1]}; {basis}",
        notation=[("+-", "one standard deviation, of what is independent from row to row.")],
    )


def _tables(found: ImportedLog) -> Iterator[ReportTable]:
    table = found.table
    names = [n for n in _SHOWN if n in table]
    columns = {n: table[n] for own in names for n in (own, f"{own}_std") if n in table}
    about = "Means of the steady windows; +- knows the autocorrelation."
    yield ReportTable.of("Rows", columns, about)
    seconds: dict[tuple[str, Remark | None], list[tuple[float, float]]] = {}
    for run, s in found.left_out():
        seconds.setdefault((run, s.why), []).append((s.start, s.stop))
    if seconds:
        entries = sorted(seconds.items(), key=lambda e: -sum(b - a for a, b in e[1]))
        spans = [", ".join(f"{a:.1f} to {b:.1f}" for a, b in own[:4]) for _, own in entries]
        yield ReportTable(
            "Left out",
            [
                Column("run", [run for (run, _), _ in entries]),
                Column("seconds", [sum(b - a for a, b in own) for _, own in entries], digits=3),
                Column("where, s", spans),
                Column("why", [str(why) for (_, why), _ in entries]),
            ],
        )
    if found.shared:
        shared = sorted(found.shared, key=lambda p: (p.quantity, -p.rms))
        yield ReportTable(
            "Errors that all rows share",
            [
                Column("uncertain", [_constant(part.constant) for part in shared]),
                Column("changes the", [part.quantity.replace("_", " ") for part in shared]),
                Column(
                    "rms", [p.rms for p in shared], [_UNITS[p.quantity] for p in shared], digits=2
                ),
            ],
            "From the uncertainties of the map. Averaging more rows does not lessen them.",
        )


def _constant(name: str) -> str:
    owner, _, own = name.replace("_", " ").rpartition(".")
    return f"{own} of [{owner.replace(' ', '_')}]" if owner else own


def _pictures(found: ImportedLog) -> Iterator[Picture]:
    count = len(panels_over_slip(found.table, found.radius))
    yield Picture(
        "The rows over slip",
        partial(plot_rows, found.table, found.radius),
        1,
        count,
        (5.0 * count, 3.6),
        f"{len(found.table)} rows over slip",
        "Bars are 90 % intervals of each row, from its scatter. Errors that all rows share come in "
        "addition.",
    )
    for series in found.series[:MOST_RUNS]:
        panels = len(run_panels(series))
        notes = "; ".join(note.text for note in series.notes)
        yield Picture(
            f"Run {series.run}",
            partial(draw_run, series, found.table),
            panels,
            1,
            (6.4, 1.05 * panels + 0.6),
            f"run {series.run}: {sum(not s.why for s in series.stretches)} steady windows",
            f"Blue: steady windows, each of which became a row; marks: means with 90 % intervals. "
            f"Grey: left out. {notes}".rstrip(),
        )


def _kept_share(found: ImportedLog) -> str:
    total = sum(float(s.time[-1] - s.time[0]) for s in found.series)
    kept = sum(w.stop - w.start for s in found.series for w in s.stretches if not w.why)
    return format_quantity(kept / total if total else 0.0, "share", digits=2)
