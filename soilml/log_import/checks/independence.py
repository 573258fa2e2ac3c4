"""Channels that were computed and not measured: their errors are shared by all rows.

A logger that writes torque as a constant times the current of the motor, or load as mass times
gravity, has one measurement and not two. Scatter of such a column says nothing of its error.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.runs import Run
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.units import dimension
from soilml.remarks import Remark

#: Shared error of a torque from a current: of torque constant and efficiency, as data sheets state
#: them; of a load from a mass, as a rover is weighed.
_TORQUE, _LOAD = 0.1, 0.02
_CURRENT = re.compile(
    r"(?<![a-z])(?:i|amps?|.*current.*|.*strom.*|corriente|courant|corrente)(?![a-z])"
)
_SAME = 0.003  # Scatter about a straight line, over all scatter, below which one is of the other
_FEWEST = 8  # Fewest samples that tell


def with_shared_errors(wheel: WheelMap, runs: Sequence[Run]) -> tuple[WheelMap, list[Remark]]:
    """The wheel with the shared errors of what was computed, and a remark for each.

    A larger error that the map states is kept; a load with any is left as it is.
    """
    channels, remarks = dict(wheel.channels), []
    torque, load = channels.get("torque"), channels.get("load")
    source = ""
    if torque is not None and len(torque.columns) == 1 and torque.shared.share < _TORQUE:
        source = _current_of(runs[0], torque.columns[0])
    if torque is not None and source:
        channels["torque"] = replace(torque, shared=replace(torque.shared, share=_TORQUE))
        text = (
            f"[torque] is a constant times the current {source!r}: it was computed and not "
            f"measured, so that all rows share its error; it counts as {_TORQUE:.0%}, write bias "
            "in [torque] where it is larger"
        )
        remarks.append(Remark("computed-torque", text, ("torque",)))
    stated = load is None or bool(load.shared.share or load.shared.constant)
    if (
        load is not None
        and load.columns
        and not stated
        and all(_is_computed(wheel, r) for r in runs)
    ):
        channels["load"] = replace(load, shared=replace(load.shared, share=_LOAD))
        text = (
            "[load] is a constant or follows from the slope: it was computed from a mass and not "
            f"measured, so that all rows share its error; it counts as {_LOAD:.0%}, write bias in "
            "[load] for another"
        )
        remarks.append(Remark("computed-load", text, ("load",)))
    return replace(wheel, channels=channels), remarks


def _current_of(run: Run, address: str) -> str:
    """The current of which a column is a constant multiple; "" for none."""
    name, (_, values) = address.rpartition(":")[2], run.find(address)
    for recording in run.recordings:
        if name not in recording.columns or recording.columns[name] is not values:
            continue
        for other, current in recording.columns.items():
            kind = dimension(unit) if (unit := recording.units.get(other, "")) else None
            named = bool(_CURRENT.search(other.lower())) and kind in (None, "A")
            if other != name and (kind == "A" or named) and _follows(values, current):
                return other
    return ""


def _is_computed(wheel: WheelMap, run: Run) -> bool:
    """Whether the load is one number, or one number times the cosine of the slope."""
    load, slope = wheel.channels["load"], wheel.channels.get("slope")
    samples = [run.find(address)[1] for address in load.columns]
    known = samples[0][np.isfinite(samples[0])]
    if len(samples) > 1 or known.size < _FEWEST or not known[0]:
        return False
    if np.ptp(known) == 0.0:
        return True
    if slope is None or len(slope.columns) != 1:
        return False
    angle = run.find(slope.columns[0])[1]
    return angle.size == samples[0].size and _follows(samples[0], np.cos(slope.scale * angle))


def _follows(values: Floats, other: Floats) -> bool:
    """Whether a column (n,) is a straight line over another one (n,), but for its digits."""
    good = np.isfinite(values) & np.isfinite(other)
    if good.sum() < _FEWEST or np.ptp(values[good]) == 0.0 or np.ptp(other[good]) == 0.0:
        return False
    together = float(np.corrcoef(values[good], other[good])[0, 1])
    return bool(1.0 - together**2 < _SAME**2)
