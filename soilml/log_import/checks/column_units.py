"""Channels of a map whose columns state a unit of another kind in the log."""

from __future__ import annotations

from collections.abc import Iterator

from soilml.log_import.channels.runs import Run
from soilml.log_import.mapping.channel_map import UNITS, ChannelMap
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.units import dimension, factor, is_raw_signal
from soilml.remarks import Remark

#: Kinds that a channel may have beside its own, where `unit` or a calibration brings it there.
_ALSO = {"load": {"kg"}, "drawbar_pull": {"kg"}, "slope": {"m/s^2", "1"}}
_SAME = 1e-3  # Relative difference of two units of the same size


def unit_hints(log_map: LogMap, wheel: WheelMap, run: Run) -> list[Remark]:
    """Refusals of columns that the log states to be of another kind: a moment as a sinkage.

    A channel with a scale of its own is not judged: somebody knows better than the header.
    """
    found = []
    for role, channel in wheel.channels.items():
        for column, stated in _stated(channel, run):
            kind = dimension(stated)
            wanted = {UNITS[role], *_ALSO.get(role, ())}
            if kind is None or kind in wanted or is_raw_signal(stated) or kind == "1":
                continue
            text = (
                f"{log_map.source}: the log states {stated} for {column!r}, which is no unit of "
                f"[{role}]"
            )
            found.append(Remark("unit-of-another-kind", text, (role,)))
    return found


def differing_units(wheel: WheelMap, run: Run) -> list[Remark]:
    """Remarks on channels that the map reads in another unit than the log states."""
    found = []
    for role, channel in wheel.channels.items():
        for column, stated in _stated(channel, run):
            ours = UNITS[role]
            if not channel.unit or dimension(stated) != ours or dimension(channel.unit) != ours:
                continue
            ratio = factor(channel.unit, ours, role) / factor(stated, ours, role)
            if abs(ratio - 1.0) > _SAME:
                text = f"[{role}] is read in {channel.unit}; the log states {stated} for {column!r}"
                found.append(Remark("unit-differs", text, (role,)))
    return found


def _stated(channel: ChannelMap, run: Run) -> Iterator[tuple[str, str]]:
    """Columns of a channel with the unit that the log states, where it does."""
    if channel.has_scale:
        return
    for address in channel.columns:
        name = address.rpartition(":")[2]
        for recording in run.recordings:
            unit = recording.units.get(address) or recording.units.get(name, "")
            if unit and dimension(unit):
                yield address, unit
                break
