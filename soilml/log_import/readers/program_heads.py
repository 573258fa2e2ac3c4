"""What the files of some programs say of their columns, or leave out: Chrono and LabVIEW."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from soilml.io.cell_text import read_number
from soilml.log_import.readers.text_layout import TextLayout
from soilml.log_import.units import known_unit

#: Files that a program writes without a header: name of the file -> columns with their units.
#: DBP.dat is of the drawbar-pull rig in Chrono::Vehicle's co-simulation (OutputData of
#: ChVehicleCosimWheeledMBSNode.cpp), whose slip is 1 - v/(r omega).
_HEADERS: dict[str, tuple[tuple[str, str], ...]] = {
    "DBP.dat": (
        ("time", "s"), ("lin_vel", "m/s"), ("ang_vel", "rad/s"), ("slip", "1"),
        ("slip_filtered", "1"), ("DBP", "N"), ("DBP_filtered", ""),
    ),
}  # fmt: skip


def known_header(file: Path, layout: TextLayout) -> TextLayout:
    """The layout with the names that a program is known to give this file, which has no header."""
    header = _HEADERS.get(file.name, ())
    unnamed = layout.names == tuple(f"column_{i + 1}" for i in range(len(layout.names)))
    if not unnamed or len(header) != len(layout.names):
        return layout
    names, units = zip(*header, strict=True)
    return replace(layout, names=names, units=units)


def with_labview_head(layout: TextLayout) -> TextLayout:
    """The layout with the units, and the rate where there is no clock, of the head of a .lvm file.

    Of signals with one clock, or none: the first column is `X_Value`, the last one `Comment`.
    """
    said = {}
    for line in layout.about:
        key, *cells = (cell.strip() for cell in line.split(layout.separator))
        said[key] = [cell for cell in cells if cell]
    labels, step = said.get("Y_Unit_Label", []), said.get("Delta_X", ["0"])[0]
    signals = [n for n in layout.names if not n.startswith(("X_Value", "Comment"))]
    if "Writer_Version" not in said or "Multi_Headings" not in said:
        return layout
    own = dict(zip(signals, labels, strict=False)) if len(labels) == len(signals) else {}
    if said.get("X_Dimension", [""])[0] == "Time":
        own["X_Value"] = "s"
    units = tuple(
        unit or (own.get(name, "") if known_unit(own.get(name, "")) else "")
        for name, unit in zip(layout.names, layout.units, strict=True)
    )
    about = layout.about
    if said.get("X_Columns") == ["No"] and (seconds := _seconds(step)) > 0.0:
        about = (*about, f"rate: {1.0 / seconds:g} Hz")
    return replace(layout, units=units, about=about)


def _seconds(text: str) -> float:
    try:
        return read_number(text.replace(",", "."))
    except ValueError:
        return 0.0
