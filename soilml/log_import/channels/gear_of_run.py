"""Which gear was driven in a run, and its radius, where a campaign has several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from soilml.errors import InputError, did_you_mean
from soilml.log_import.channels.runs import Run
from soilml.log_import.mapping.log_map import LogMap, WheelMap


def gear_of(wheel: WheelMap, run: Run) -> str:
    """The gear of a wheel in a run; "" where the map states none.

    Raises `InputError` where neither the name of the run nor that of its file has it.
    """
    if wheel.gear_pattern is None:
        return wheel.gear
    for text in (run.name, run.recordings[0].file.name):
        if match := wheel.gear_pattern.search(text):
            return match[match.re.groups]
    raise InputError(
        f"[wheel] gear_from {wheel.gear_pattern.pattern!r} finds nothing in the name of the run "
        f"{run.name!r}, nor in {run.recordings[0].file.name!r}"
    )


def wheels_by_gear(
    log_map: LogMap, wheel: WheelMap, runs: Sequence[Run]
) -> list[tuple[WheelMap, list[int]]]:
    """The wheel with each gear that it had, with the gear's radius, and the indices of its runs.

    One wheel with all runs where the map has no [gears]. Names of gears are compared whatever the
    case of their letters.

    Raises `InputError` where a run has a gear that [gears] lacks, and no other radius is given; and
    as `gear_of` does.
    """
    if not log_map.gears or wheel.gear_pattern is None:
        return [(wheel, list(range(len(runs))))]
    names = {name.casefold(): name for name in log_map.gears}
    found: dict[str, list[int]] = {}
    for i, run in enumerate(runs):
        gear = gear_of(wheel, run)
        known = names.get(gear.casefold())
        if known is None and wheel.radius is None:
            raise InputError(
                f"{log_map.source}: run {run.name!r} has the gear {gear!r}, and [gears] does not; "
                f"{did_you_mean(gear, names.values())}there are {', '.join(log_map.gears)}; add "
                f"[gears.{gear}] with its radius, or correct gear_from"
            )
        found.setdefault(known or gear, []).append(i)
    return [
        (
            replace(
                wheel,
                gear=gear,
                gear_pattern=None,
                radius=log_map.gears.get(gear, wheel.radius),
            ),
            own,
        )
        for gear, own in found.items()
    ]
