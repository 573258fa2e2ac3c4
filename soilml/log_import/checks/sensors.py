"""Sensors that are dead in a run, that clip, or that were not tared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.log_import.channels.inputs import Inputs, moving
from soilml.log_import.mapping.channel_map import UNITS
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.rows import WindowRow
from soilml.remarks import Remark

#: Sensors that respond when a wheel drives, and those that read zero before it starts.
_RESPONDING = ("torque", "motor_current", "load", "drawbar_pull", "sinkage")
_WITH_A_ZERO = ("torque", "drawbar_pull", "motor_current", "sinkage")
_DEAD_LEVEL = 0.05  # A sensor is dead below this share of its usual level in the other runs
_SUNK = 0.5  # Share of the radius to which a wheel sinks in at rest
#: A reading at rest counts as an offset above this share of the reading while driving.
_OFFSET = 0.05
#: A sensor clips where its largest reading stands in so many samples, such a share of them, and so
#: many times more often than any other.
_FEWEST_CLIPPED, _CLIPPED, _OFTEN = 20, 0.02, 5


def dead_sensors(runs: Sequence[Inputs]) -> list[dict[str, str]]:
    """For each run of a wheel, the roles whose sensor is dead, with the reason."""
    levels = [{role: _level(inputs, role) for role in inputs.values} for inputs in runs]
    # a load that is a constant above zero in all runs is a weight that the log states
    loads = [own[np.isfinite(own)] for i in runs if (own := i.values.get("load")) is not None]
    stated = all(own.size > 0 and np.ptp(own) == 0.0 and own[0] > 0.0 for own in loads)
    found: list[dict[str, str]] = []
    for i, inputs in enumerate(runs):
        dead = {}
        for role, values in inputs.values.items():
            known = values[np.isfinite(values)]
            others = [own[role] for k, own in enumerate(levels) if k != i and role in own]
            usual = float(np.nanmedian(others)) if len(others) >= 2 else float("nan")
            if known.size == 0:
                dead[role] = "it has no samples"
            elif role == "load" and stated:
                continue
            elif np.ptp(known) == 0.0 and role in (*_RESPONDING, "wheel_speed"):
                dead[role] = f"it reads {known[0]:.3g} throughout"
            elif role in _RESPONDING and levels[i][role] < _DEAD_LEVEL * usual:
                level = f"{levels[i][role]:.2g}"
                dead[role] = f"it reads {level} while driving, {usual:.2g} in the other runs"
        found.append(dead)
    return found


def _level(inputs: Inputs, role: str) -> float:
    """Usual size of a channel while the wheel drives, beside its reading at rest where known."""
    values = inputs.values[role]
    if not np.isfinite(values).any():
        return float("nan")
    driving = values[moving(inputs)]
    middle = np.nanmedian(driving if np.isfinite(driving).any() else values)
    rest = inputs.rest.get(role, (0.0, 0.0))[0] if role != "load" else 0.0
    return float(np.abs(middle - np.nan_to_num(rest)))


def drop_clipped(inputs: Inputs, rows: Sequence[WindowRow]) -> list[Remark]:
    """Take readings at the end of a sensor's range out of rows, and say of how many.

    The largest reading of a sensor that cannot show more stands in many samples, far more often
    than any other.
    """
    found = []
    for role in [role for role in _RESPONDING if role in inputs.values]:
        size = np.abs(inputs.values[role])
        levels, counts = np.unique(size[np.isfinite(size)], return_counts=True)
        if counts.size < 2 or counts[-1] < max(
            _FEWEST_CLIPPED, _CLIPPED * counts.sum(), _OFTEN * np.max(counts[:-1])
        ):
            continue
        name, limit = "torque" if role == "motor_current" else role, float(levels[-1])
        clipped = size >= limit
        spoilt = [row for row in rows if name in row.values and np.mean(
            clipped[inputs.within(row.window.start, row.window.stop)]) > _CLIPPED]  # fmt: skip
        for row in spoilt:
            del row.values[name]
            row.means[role] = float("nan")
        text = (
            f"[{role}] reads {limit:.4g} in {int(clipped.sum())} samples and never more: its "
            f"sensor clips; {len(spoilt)} of {len(rows)} windows are without it"
        )
        found.append(Remark("clipped", text, (role,)))
    return found


def offset_at_rest(inputs: Inputs, role: str) -> float:
    """What a sensor reads before the wheel starts, where that is more than noise and worth a tare.

    0 where it is not, and where the wheel never rests.
    """
    mean, error = inputs.rest.get(role, (0.0, 0.0))
    if role not in inputs.values or not abs(mean) > 5.0 * np.nan_to_num(error):
        return 0.0
    return mean if abs(mean) > _OFFSET * _level(inputs, role) else 0.0


def untared_sensors(wheel: WheelMap, runs: Sequence[Inputs]) -> list[Remark]:
    """Sensors that read something at rest, where they should read zero, and are not tared."""
    found = []
    most = _SUNK * (wheel.radius.value if wheel.radius else 0.1)
    for role in _WITH_A_ZERO:
        channel = wheel.channels.get(role)
        own = runs if channel is not None and channel.tare is None else ()
        offsets = [offset for inputs in own if (offset := offset_at_rest(inputs, role))]
        if role == "sinkage":  # a wheel at rest has sunk in
            offsets = [offset for offset in offsets if not 0.0 < offset < most]
        if len(offsets) > len(runs) / 2:
            text = (
                f"[{role}] reads {float(np.median(offsets)):.3g} {UNITS[role]} before the wheel "
                f"starts ({len(offsets)} of {len(runs)} runs): add tare = 'rest' where it should "
                "read zero there"
            )
            found.append(Remark("not-tared", text, (role,)))
    return found
