"""Sensors that are dead in a run, that clip, or that were not tared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.log_import.channels.inputs import Inputs, moving
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.rows import WindowRow
from soilml.remarks import Remark

#: Sensors that respond when a wheel drives.
_RESPONDING = ("torque", "motor_current", "load", "drawbar_pull", "sinkage")
_DEAD_LEVEL = 0.05  # A sensor is dead below this share of its usual level in the other runs
_SUNK = 0.5  # Share of the radius to which a wheel sinks in at rest
#: A reading at rest counts as an offset above this share of the reading while driving.
_OFFSET = 0.05
#: A sensor clips where its largest reading stands in so many samples, such a share of them, and so
#: many times more often than any other.
_FEWEST_CLIPPED, _CLIPPED, _OFTEN = 20, 0.02, 5


def dead_sensors(runs: list[Inputs]) -> list[dict[str, str]]:
    """For each run of a wheel, the roles whose sensor is dead, with the reason."""
    levels = {role: [_level(inputs, role) for inputs in runs] for role in _roles(runs)}
    stated = _stated_load(runs)
    found: list[dict[str, str]] = []
    for i, inputs in enumerate(runs):
        dead = {}
        for role, values in inputs.values.items():
            known = values[np.isfinite(values)]
            if known.size == 0:
                dead[role] = "it has no samples"
            elif role == "load" and stated:
                continue
            elif np.ptp(known) == 0.0 and role in (*_RESPONDING, "wheel_speed"):
                dead[role] = f"it reads {known[0]:.3g} throughout"
            elif role in _RESPONDING:
                others = [level for k, level in enumerate(levels[role]) if k != i]
                usual = float(np.nanmedian(others)) if len(others) >= 2 else float("nan")
                if levels[role][i] < _DEAD_LEVEL * usual:
                    dead[role] = (
                        f"it reads {levels[role][i]:.2g} while driving, {usual:.2g} in the other "
                        "runs"
                    )
        found.append(dead)
    return found


def _stated_load(runs: list[Inputs]) -> bool:
    """Whether the load is a constant above zero in all runs: a weight that the log states."""
    loads = [inputs.values["load"] for inputs in runs if "load" in inputs.values]
    known = [own[np.isfinite(own)] for own in loads]
    return all(own.size > 0 and np.ptp(own) == 0.0 and own[0] > 0.0 for own in known)


def _roles(runs: list[Inputs]) -> list[str]:
    return list(dict.fromkeys(role for inputs in runs for role in inputs.values))


def _level(inputs: Inputs, role: str) -> float:
    """Usual size of a channel while the wheel drives, beside its reading at rest where known."""
    values = inputs.values.get(role)
    if values is None or not np.isfinite(values).any():
        return float("nan")
    driving = values[moving(inputs)]
    if not np.isfinite(driving).any():
        driving = values
    rest = inputs.rest.get(role, (0.0, 0.0))[0] if role != "load" else 0.0
    return float(np.abs(np.nanmedian(driving) - (rest if np.isfinite(rest) else 0.0)))


def clipped_at(inputs: Inputs) -> dict[str, float]:
    """The largest reading of sensors that cannot show more, by role.

    That is a reading which stands in many samples, far more often than any other.
    """
    found = {}
    for role in {*_RESPONDING} & inputs.values.keys():
        size = np.abs(inputs.values[role][np.isfinite(inputs.values[role])])
        levels, counts = np.unique(size, return_counts=True)
        if counts.size < 2:
            continue
        others = int(np.max(counts[:-1]))
        if counts[-1] >= max(_FEWEST_CLIPPED, _CLIPPED * size.size, _OFTEN * others):
            found[role] = float(levels[-1])
    return found


def drop_clipped(inputs: Inputs, rows: Sequence[WindowRow]) -> list[Remark]:
    """Take readings at the end of a sensor's range out of rows, and say of how many."""
    found = []
    for role, limit in clipped_at(inputs).items():
        name = "torque" if role == "motor_current" else role
        clipped = np.abs(inputs.values[role]) >= limit
        spoilt = [
            row for row in rows if name in row.values and np.mean(
                clipped[(inputs.time >= row.window.start) & (inputs.time <= row.window.stop)]
            ) > _CLIPPED
        ]  # fmt: skip
        for row in spoilt:
            del row.values[name]
            row.means[role] = float("nan")
        text = (
            f"[{role}] reads {limit:.4g} in {int(clipped.sum())} samples and never more: its "
            f"sensor clips; {len(spoilt)} of {len(rows)} windows are without it"
        )
        found.append(Remark("clipped", text, (role,)))
    return found


def untared_sensors(wheel: WheelMap, runs: list[Inputs]) -> list[Remark]:
    """Sensors that read something at rest, where they should read zero, and are not tared."""
    found = []
    for role, unit in (("torque", "N m"), ("drawbar_pull", "N"), ("motor_current", "A"),
                       ("sinkage", "m")):  # fmt: skip
        channel = wheel.channels.get(role)
        if channel is None or channel.tare is not None:
            continue
        offsets: list[float] = []
        shares: list[float] = []
        for inputs in runs:
            if role not in inputs.rest or role not in inputs.values:
                continue
            mean, error = inputs.rest[role]
            if role == "sinkage" and 0.0 < mean < _SUNK * (
                wheel.radius.value if wheel.radius else 0.1
            ):
                continue  # a wheel at rest has sunk in
            level = _level(inputs, role)
            if np.isfinite(mean) and abs(mean) > 5.0 * np.nan_to_num(error):
                offsets.append(mean)
                shares.append(abs(mean) / level if level else np.inf)
        if offsets and float(np.median(shares)) > _OFFSET:
            text = (
                f"[{role}] reads {float(np.median(offsets)):.3g} {unit} before the wheel starts "
                f"({len(offsets)} of {len(runs)} runs), {float(np.median(shares)):.0%} of its "
                "reading while driving: add tare = 'rest' where it should read zero there"
            )
            found.append(Remark("not-tared", text, (role,)))
    return found


def untared_load(wheel: WheelMap, runs: list[Inputs]) -> list[Remark]:
    """A load that is not tared, beside a pull of the same kind of sensor with a large offset.

    What a load sensor reads too much cannot be seen while the wheel stands in the soil.
    """
    load, pull = wheel.channels.get("load"), wheel.channels.get("drawbar_pull")
    if load is None or pull is None or not load.columns or load.tare is not None:
        return []
    if pull.tare is None or load.bias.constant > 0.0:
        return []
    shares = [
        abs(inputs.tare["drawbar_pull"]) / level
        for inputs in runs
        if "drawbar_pull" in inputs.tare and (level := _level(inputs, "load")) > 0.0
    ]
    if not shares or float(np.median(shares)) < _OFFSET:
        return []
    offset = float(
        np.median([abs(i.tare["drawbar_pull"]) for i in runs if "drawbar_pull" in i.tare])
    )
    share = f"{float(np.median(shares)):.0%} of the load"
    text = (
        f"[drawbar_pull] read {offset:.3g} N before the wheel started, {share}: if one sensor "
        "measures both, the load may be wrong by as much, which no log shows; tare it with the "
        f"wheel lifted, give [load] value = the weight, or write bias = '1 % + {offset:.2g}' in "
        "[load]"
    )
    return [Remark("load-not-tared", text, ("load", "drawbar_pull"))]
