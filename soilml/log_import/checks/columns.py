"""Columns of a map that do not measure their channel: of a unit of another kind, or computed.

A logger that writes torque as a constant times the current of the motor, or load as mass times
gravity, has one measurement and not two. Scatter of such a column says nothing of its error, which
all rows share.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.log_import.channels.runs import Run
from soilml.log_import.mapping.channel_map import UNITS
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.units import dimension, factor, is_raw_signal
from soilml.remarks import Remark

#: Kinds that a channel may have beside its own, where `unit` or a calibration brings it there.
_ALSO = {"load": {"kg"}, "drawbar_pull": {"kg"}, "slope": {"m/s^2", "1"}}
_SAME_UNIT = 1e-3  # Relative difference of two units of the same size
#: Shared error of a torque from a current: of torque constant and efficiency, as data sheets state
#: them; of a load from a mass, as a rover is weighed.
_TORQUE, _LOAD = 0.1, 0.02
_CURRENT = re.compile(
    r"(?<![a-z])(?:i|amps?|.*current.*|.*strom.*|corriente|courant|corrente)(?![a-z])"
)
_SAME = 0.003  # Scatter about a straight line, over all scatter, below which one is of the other
_FEWEST = 8  # Fewest samples that tell


def unit_remarks(wheel: WheelMap, run: Run) -> Iterator[Remark]:
    """Columns that the log states to be of another kind, as a moment for a sinkage, which is
    wrong (`unit-of-another-kind`); and channels that the map reads in another unit.

    A channel with a scale of its own is not judged: somebody knows better than the header.
    """
    for role, channel in wheel.channels.items():
        for address in channel.columns if not channel.has_scale else ():
            name, ours = address.rpartition(":")[2], UNITS[role]
            units = (r.units.get(address) or r.units.get(name, "") for r in run.recordings)
            unit = next((unit for unit in units if unit and dimension(unit)), "")
            kind, read = dimension(unit) if unit else "1", channel.unit
            if kind not in {ours, "1", *_ALSO.get(role, ())} and not is_raw_signal(unit):
                text = f"the log states {unit} for {address!r}, which is no unit of [{role}]"
                yield Remark("unit-of-another-kind", text, (role,))
            elif not unit or not read or not kind == ours == dimension(read):
                continue
            elif abs(factor(read, ours) / factor(unit, ours) - 1.0) > _SAME_UNIT:
                text = f"[{role}] is read in {read}; the log states {unit} for {address!r}"
                yield Remark("unit-differs", text, (role,))


def with_shared_errors(wheel: WheelMap, runs: Sequence[Run]) -> tuple[WheelMap, list[Remark]]:
    """The wheel with the shared errors of what was computed, and a remark for each.

    A larger error that the map states is kept; a load with any is left as it is.
    """
    channels, computed = dict(wheel.channels), {}
    torque, load = channels.get("torque"), channels.get("load")
    exact = torque is not None and len(torque.columns) == 1 and torque.shared.share < _TORQUE
    if torque and exact and (source := _current_of(runs[0], torque.columns[0])):
        computed["torque"] = _TORQUE, f"is a constant times the current {source!r}: it was"
    exact = load is not None and bool(load.columns) and load.shared == Noise()
    if exact and all(_is_of_a_mass(wheel, run) for run in runs):
        computed["load"] = _LOAD, "is a constant or follows from the slope: from a mass it was"
    remarks = []
    for role, (share, text) in computed.items():
        channels[role] = replace(channels[role], shared=replace(channels[role].shared, share=share))
        text = (
            f"[{role}] {text} computed and not measured, so that all rows share its error; it "
            f"counts as {share:.0%}, write bias in [{role}] where it is larger"
        )
        remarks.append(Remark(f"computed-{role}", text, (role,)))
    return replace(wheel, channels=channels), remarks


def _current_of(run: Run, address: str) -> str:
    """The current of which a column is a constant multiple; "" for none."""
    name, (_, values) = address.rpartition(":")[2], run.find(address)
    for recording in (r for r in run.recordings if r.columns.get(name) is values):
        for other, current in recording.columns.items():
            kind = dimension(unit) if (unit := recording.units.get(other, "")) else None
            named = bool(_CURRENT.search(other.lower())) and kind is None
            if other != name and (kind == "A" or named) and _follows(values, current):
                return other
    return ""


def _is_of_a_mass(wheel: WheelMap, run: Run) -> bool:
    """Whether the load is one number, or one number times the cosine of the slope."""
    load, slope = wheel.channels["load"], wheel.channels.get("slope")
    samples = run.find(load.columns[0])[1]
    known = samples[np.isfinite(samples)]
    if len(load.columns) > 1 or known.size < _FEWEST or not known[0]:
        return False
    if np.ptp(known) == 0.0 or slope is None or len(slope.columns) != 1:
        return bool(np.ptp(known) == 0.0)
    angle = run.find(slope.columns[0])[1]
    return angle.size == samples.size and _follows(samples, np.cos(slope.scale * angle))


def _follows(values: Floats, other: Floats) -> bool:
    """Whether a column (n,) is a straight line over another one (n,), but for its digits."""
    good = np.isfinite(values) & np.isfinite(other)
    if good.sum() < _FEWEST or np.ptp(values[good]) == 0.0 or np.ptp(other[good]) == 0.0:
        return False
    together = float(np.corrcoef(values[good], other[good])[0, 1])
    return bool(1.0 - together**2 < _SAME**2)
