"""A wheel that is lifted at the end of a run: its load sensor shows its zero there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.mapping.log_map import WheelMap

#: Longest share of the load that a lifted wheel shows, least share that is an offset, shortest
#: stretch in s.
_LIFTED, _OFFSET, _SHORTEST = 0.3, 0.01, 1.0


def lifted_at_the_end(wheel: WheelMap, names: Sequence[str], runs: Sequence[Inputs]) -> list[str]:
    """A remark where a load that is not tared falls at the end of runs, and not to zero."""
    channel = wheel.channels.get("load")
    if channel is None or not channel.columns or channel.tare is not None:
        return []
    found = []
    for name, inputs in zip(names, runs, strict=True):
        load = inputs.values["load"]
        known = np.flatnonzero(np.isfinite(load))
        usual = float(np.median(load[known])) if known.size else 0.0
        held = known[load[known] > _LIFTED * usual]
        start = int(held[-1]) + 1 if held.size else load.size
        own = load[start:][np.isfinite(load[start:])]
        if usual <= 0.0 or own.size * inputs.step < _SHORTEST:
            continue
        zero = float(np.median(own))
        if abs(zero) > _OFFSET * usual:
            first, last = inputs.time[start], inputs.time[-1]
            found.append((name, zero, usual, first + 0.2 * (last - first), last))
    if not found:
        return []
    name, zero, usual, first, last = found[0]
    return [
        f"[load] falls from {usual:.3g} to {zero:.3g} N at the end of {len(found)} of {len(runs)} "
        f"runs: if the wheel is lifted there, that is the zero of the sensor; write tare = "
        f"[{first:.1f}, {last:.1f}] in [load], times of the run {name}"
    ]
