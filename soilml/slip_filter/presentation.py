"""A drive's slips and soils as columns, as JSON, and as a picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.quantities import QUANTITIES
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_band
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable
from soilml.slip_filter.drive import DriveSlip

ENDS = ("_p05", "", "_p95")


def drive_columns(found: DriveSlip) -> dict[str, Any]:
    """A row for each time, in SI units, with medians and 90 % intervals; refused rows are blank."""
    columns: dict[str, Any] = {"time_s": found.rows.time}
    columns |= _band("speed_m_s", found.speed)
    for i, name in enumerate(found.rows.wheels):
        columns |= _band(f"slip_{name}", found.slip[:, :, i])
    for i, name in enumerate(found.names):
        key = QUANTITIES[name].column if name in QUANTITIES else name
        columns |= _band(key, found.soil[:, :, i])
    columns["no_soil"] = found.no_soil
    columns["flags"] = np.asarray([" ".join(own) for own in found.flags])
    return columns


def _band(name: str, values: Floats) -> dict[str, Floats]:
    """The median first, then the ends."""
    return {f"{name}{ENDS[j]}": values[:, j] for j in (1, 0, 2)}


def report_of_drive(found: DriveSlip, title: str = "Slip of a drive") -> Report:
    """The report of a drive: slips at its end, how well they are known, flags."""
    answered = found.answered
    count, known = len(answered), int(answered.sum())
    verdict = f"None of {count} rows has a slip: see the flags."
    lines = [f"{known} of {count} rows have a slip; {count - known} are refused or passed over."]
    if known:
        slip = found.slip[answered].max(axis=2)
        low, middle, high = found.slip[np.flatnonzero(answered)[-1]].max(axis=1)
        verdict = f"The largest slip of a wheel is {slip[:, 1].max():.2f}; at the last row it is "
        verdict += f"{format_band(low, middle, high, digits=2)}."
        width = np.median(slip[:, 2] - slip[:, 0])
        lines.append(f"Half of the 90 % intervals are at most {width:.2f} wide.")
    flags = [name for own in found.flags for name in own]
    names = sorted(set(flags), key=flags.count, reverse=True)
    columns = [Column("flag", names), Column("rows", [flags.count(name) for name in names])]
    return Report(
        kind="slip",
        verdict=verdict,
        lines=lines,
        tables=[ReportTable("Flags", columns)] if names else [],
        pictures=[
            column_picture(
                drive_columns(found) | {"pitch_rad": found.rows.slope},
                "time_s",
                [[f"slip_{name}" for name in found.rows.wheels], ["speed_m_s"], ["pitch_rad"]],
                title="The drive",
                caption="Lines: medians. Bands: 90 %.",
            )
        ],
        remarks=list(found.remarks()),
        status=f"{known} of {count} rows",
        tone="good" if known == count else "warn" if known else "bad",
        title=title,
        basis=f"{count} rows of {len(found.rows.wheels)} wheels",
    )  # fmt: skip


def drive_json(found: DriveSlip) -> dict[str, Any]:
    """Columns and remarks."""
    columns = {name: np.asarray(values).tolist() for name, values in drive_columns(found).items()}
    return {"columns": columns, "remarks": [remark.as_json() for remark in found.remarks()]}
