"""What an audit says: which effects a design could name, and which runs would add most."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.report.figure_style import AFTER, UNCHANGED
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable

if TYPE_CHECKING:
    from soilml.gap.identifiability import Audit

_MOST_RUNS = 5  # Runs to add that are listed


def audit_report(found: Audit, nameable_from: float) -> Report:
    """The report of an audit; `nameable_from` is the least sigma that names an effect."""
    named = [e.name for e in found.effects if e.nameable]
    count = len(found.effects) + len(found.untestable)
    gaining = [run for run in found.added_runs if run.gained]
    verdict = f"These runs could name {len(named)} of {count} effects; no single run adds one."
    if gaining:
        kind = gaining[0].kind.replace("_", " ")
        verdict = f"These runs could name {len(named)} of {count} effects; "
        verdict += f"add {kind} to name {len(gaining[0].gained)} more."
    effects = found.effects
    tables = []
    if gaining:
        shown = gaining[:_MOST_RUNS]
        tables.append(
            ReportTable(
                "Runs to add",
                [
                    Column("kind", [run.kind for run in shown]),
                    Column("effects more", [len(run.gained) for run in shown]),
                    Column("what", [f"{run.text}: {', '.join(run.gained)}" for run in shown]),
                ],
                "Effects that could then be named.",
            )
        )
    if effects:
        units = [e.unit for e in effects]
        rivals = [", ".join(f"{n} {c:.2f}" for n, c in e.rivals[:1]) for e in effects]
        tables.append(
            ReportTable(
                "Effects",
                [
                    Column("effect", [e.name for e in effects]),
                    Column("nameable", [e.nameable for e in effects]),
                    Column("left", [e.residual_signal for e in effects], digits=3),
                    Column("apart", [e.separating_snr for e in effects], digits=3),
                    Column("size", [e.size for e in effects], units, digits=3),
                    Column("detectable", [e.detectable_size for e in effects], units,
                           digits=2, sizes=[e.size for e in effects]),
                    Column("absorbed", [e.absorbed for e in effects], "share", digits=2),
                    Column("rival", rivals),
                ],
                "Signals in sigma at the reference size: left beside the soil, and apart from the "
                "most similar effect. Absorbed: the share that the soil imitates.",
            )
        )  # fmt: skip
    details = [("Effects that cannot be distinguished", [", ".join(c) for c in found.classes])]
    details.append(
        ("Effects that cannot be tested", [f"{n}: {why}" for n, why in found.untestable.items()])
    )
    return Report(
        kind="plan",
        verdict=verdict,
        lines=[f"They could name: {', '.join(named)}."] if named else [],
        tables=tables,
        pictures=[_picture(found, nameable_from)] if effects else [],
        details=[entry for entry in details if entry[1]],
        status=f"{len(named)} of {count}",
        title="Effects that a design could name",
    )


def _picture(found: Audit, nameable_from: float) -> Picture:
    effects = found.effects

    def draw(axes: Any) -> None:
        panel, y = np.ravel(axes)[0], np.arange(len(effects))
        left = [e.residual_signal for e in effects]
        apart = [e.separating_snr for e in effects]
        panel.barh(y - 0.19, left, 0.36, color=UNCHANGED, label="that the soil cannot imitate")
        panel.barh(
            y + 0.19, apart, 0.36, color=AFTER, label="that separates it from its nearest rival"
        )
        panel.axvline(nameable_from, color="black", lw=1.2)
        panel.set_xscale("symlog", linthresh=1.0)
        panel.set_xlim(left=0.0)
        panel.xaxis.set_major_formatter("{x:g}")
        panel.set_yticks(y, [e.name for e in effects])
        panel.set_ylim(len(effects) - 0.5, -0.5)
        panel.set_xlabel(
            f"signal at the reference size, σ; line: {nameable_from:g} σ name an effect"
        )
        panel.legend(loc="lower right")  # the best separated stand above

    size = (5.6, 1.0 + 0.34 * len(effects))
    alt = "signal of each effect beside the soil, and beside its nearest rival"
    return Picture("Signals of the effects", draw, 1, 1, size, alt)
