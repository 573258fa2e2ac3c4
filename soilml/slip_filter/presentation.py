"""A drive's slips and soils as columns, as JSON, and as a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.quantities import QUANTITIES
from soilml.report.figure_style import AFTER, BEFORE, take_axes
from soilml.slip_filter.drive import DriveSlip

SIZE = (9.0, 7.5)  # Width and height of the figure, inches
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


def drive_text(found: DriveSlip) -> str:
    """The verdict in few lines, and the remarks."""
    answered = found.answered
    count, lines = len(answered), []
    lines.append(
        f"{count} rows of {len(found.rows.wheels)} wheels: {int(answered.sum())} have a slip, "
        f"{count - int(answered.sum())} are refused or passed over"
    )
    if answered.any():
        slip = found.slip[answered].max(axis=2)
        last = np.flatnonzero(answered)[-1]
        low, middle, high = found.slip[last].max(axis=1)
        lines.append(
            f"largest slip of a wheel: {slip[:, 1].max():.2f}; median width of its 90 % interval: "
            f"{np.median(slip[:, 2] - slip[:, 0]):.2f}"
        )
        lines.append(f"at the last row: slip {middle:.2f} ({low:.2f} to {high:.2f})")
    return "\n".join([*lines, *(f"! {remark}" for remark in found.remarks())])


def drive_json(found: DriveSlip) -> dict[str, Any]:
    """Columns and remarks."""
    columns = {name: np.asarray(values).tolist() for name, values in drive_columns(found).items()}
    return {"columns": columns, "remarks": [remark.as_json() for remark in found.remarks()]}


def plot_drive(found: DriveSlip, ax: Any = None) -> NDArray[Any]:
    """Draw largest slip, body speed, pitch and the probability of a hard floor; see `take_axes`."""
    panels = take_axes(ax, 3, 1, SIZE)
    top, middle, last = panels.ravel()
    time = found.rows.time
    slip = found.slip.max(axis=2)
    for panel, values, label in ((top, slip, "largest slip"), (middle, found.speed, "speed, m/s")):
        panel.fill_between(time, values[:, 0], values[:, 2], color=AFTER, alpha=0.25, lw=0)
        panel.plot(time, values[:, 1], color=AFTER, lw=1.5)
        panel.set_ylabel(label)
    middle.plot(time, found.rows.rim_speed.mean(axis=1), color=BEFORE, lw=1.0, label="rims")
    middle.legend(frameon=False)
    last.plot(time, np.rad2deg(found.rows.slope), color="#4d4d4d", lw=1.0)
    last.set_ylabel("pitch, degrees")
    last.set_xlabel("time, s")
    hard = found.no_soil > 0.5
    for panel in (top, middle, last):
        panel.set_xlim(time[0], max(time[-1], time[0] + 1e-9))
        panel.fill_between(
            time, 0, 1, where=hard, transform=panel.get_xaxis_transform(), color=BEFORE, alpha=0.2
        )
    return panels
