"""`soilml audit`: effects that a rig and an experimental design could identify."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from soilml.cli.option_values import available_effects, parse_costs, parse_names
from soilml.cli.output import json_text, show, tell
from soilml.cli.progress import working
from soilml.cli.table_reading import read_long_table
from soilml.config.case import read_case
from soilml.fitting.declared_discrepancy import ignored_discrepancy
from soilml.io.atomic_files import save_text
from soilml.io.text_tables import format_table
from soilml.remarks import texts
from soilml.report.terminal import shown_unit, significant

if TYPE_CHECKING:
    from soilml.gap import Audit


def run(args: argparse.Namespace) -> int:
    """Audit and print or write."""
    from soilml.gap import audit

    effects = available_effects(args)
    case = read_case(args.model, effects)
    design = read_long_table(args.design, ("run", "slip", "load_N"), ignore_extra=args.ignore_extra)
    with working(f"auditing {len(design)} rows"):
        found = audit(
            case, design, free=parse_names(args.free), effects=effects, costs=parse_costs(args)
        )
    if args.out is not None:
        save_text(args.out, json_text(found.as_json()))
    show(_text(found))
    for line in texts(
        ignored_discrepancy(case, "the audit", "effects are harder to name than it says")
    ):
        tell(line)
    return 0


def _text(found: Audit) -> str:
    rows = [
        (
            e.name,
            "yes" if e.separating_snr >= 3.0 else "no",
            f"{significant(factor * e.size)} {unit}".rstrip(),
            significant(e.residual_signal, 3),
            significant(e.separating_snr, 3),
            "never"
            if math.isinf(e.detectable_size)
            else significant(factor * e.detectable_size, 2),
            f"{e.absorbed:.0%}",
            ", ".join(f"{name} {cosine:.2f}" for name, cosine in e.rivals[:1]),
        )
        for e in found.effects
        for factor, unit in [shown_unit(e.unit)]
    ]
    header = ("effect", "nameable", "size", "left", "apart", "detectable", "absorbed", "rival")
    parts = [format_table(header, rows, text_columns=2, last_left=True)]
    if found.classes:
        parts.append(
            "these effects cannot be distinguished at their reference sizes:\n"
            + "\n".join("  " + ", ".join(c) for c in found.classes)
        )
    if found.untestable:
        lines = [f"  {name}: {why}" for name, why in found.untestable.items()]
        parts.append("cannot be tested:\n" + "\n".join(lines))
    gaining = [run for run in found.added_runs if run.gained]
    lines = [f"  {run.kind} ({run.text}): {', '.join(run.gained)}" for run in gaining[:5]]
    parts.append(
        "runs to add, and the effects that could then be named:\n" + ("\n".join(lines) or "  none")
    )
    return "\n\n".join(parts)
