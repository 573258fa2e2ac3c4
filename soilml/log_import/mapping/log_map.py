"""A map: the file that says how a log is read."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from soilml.io.toml_settings import Settings, read_settings
from soilml.log_import.mapping.channel_map import LEG_ROLES, ROLES, ChannelMap, take_channel
from soilml.log_import.mapping.uncertain_value import Uncertain, take_uncertain
from soilml.log_import.mapping.wheel_leg import WheelLegMap, take_wheel_leg
from soilml.log_import.mapping.window_settings import (
    LeaveOut,
    WindowSettings,
    take_left_out,
    take_windows,
)

#: Keys that say where samples come from, of which a table has one.
_SOURCES = ("column", "value", "file_name", "head")
_ZERO = Uncertain(0.0)


def shared_keys(settings: Settings, wheels: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """ChannelMap tables outside of the wheels, by role, of roles that some wheel has of its own.

    A table that names no source of samples is taken out of `settings`: it serves the wheels only.
    """
    own = {role for wheel in wheels.values() if isinstance(wheel, dict) for role in wheel}
    found = {}
    for role in ROLES:
        if role in own and role in settings:
            content = settings.content[role]
            if isinstance(content, dict):
                found[role] = content
                if not {*_SOURCES} & content.keys():
                    settings.take(role, dict, f"a table [{role}]")
    return found


def with_shared_keys(
    wheel: Mapping[str, Any], shared: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """The table of a wheel, whose channels have the shared keys that they do not state."""
    content = dict(wheel)
    for role, keys in shared.items():
        own = content.get(role)
        if isinstance(own, dict):
            sourced = {*_SOURCES} & own.keys()
            kept = {k: v for k, v in keys.items() if not (sourced and k in _SOURCES)}
            content[role] = kept | own
    return content


@dataclass(frozen=True)
class FileKind:
    """One kind of file, where a run has several: its name has `pattern`; how its clock is read.

    `time_column` and `time_unit` replace those of [time] where they are not "".
    """

    name: str
    pattern: str
    clock: str = "same"
    delay: float = 0.0
    time_column: str = ""
    time_unit: str = ""


@dataclass(frozen=True)
class Vehicle:
    """Masses and lengths from which the load of each wheel follows, in kg, m and m/s^2.

    `behind_front` is the distance of the centre of mass behind the front axle.
    """

    mass: Uncertain
    wheels: int = 1
    gravity: float = 9.80665
    wheelbase: Uncertain = _ZERO
    behind_front: Uncertain = _ZERO
    height: Uncertain = _ZERO


@dataclass(frozen=True)
class WheelMap:
    """A wheel: its radius (m), its channels by role, and where it stands.

    `gear_pattern` finds its gear in the name of each run or file: group 1, or the whole match.
    """

    name: str
    radius: Uncertain | None
    channels: dict[str, ChannelMap]
    gear: str = ""
    axle: str = ""
    gear_pattern: re.Pattern[str] | None = None
    leg: WheelLegMap | None = None  # Where the wheel has legs: each stance is a row


@dataclass(frozen=True)
class LogMap:
    """How a log is read; see docs/how-to/import.md for the file."""

    source: str
    wheels: tuple[WheelMap, ...]
    files: tuple[FileKind, ...] = ()
    time_column: str = ""
    time_unit: str = "s"
    rate: float = 0.0
    run_column: str = ""
    split_at_reset: bool = False
    each_struct: bool = False
    split_at_pause: float = math.inf
    vehicle: Vehicle | None = None
    windows: WindowSettings = field(default_factory=WindowSettings)
    left_out: tuple[LeaveOut, ...] = ()
    each_row: bool = False
    # Radius (m) of each gear of [gears.NAME]
    gears: Mapping[str, Uncertain] = field(default_factory=dict)

    @property
    def splits_by_time(self) -> bool:
        """Whether one file holds several runs, one after the other."""
        return self.split_at_reset or math.isfinite(self.split_at_pause)


def read_map(path: str | os.PathLike[str]) -> LogMap:
    """Read a map; raises `InputError`, naming file, table and key, for what is wrong in it."""
    settings = read_settings(path, f"soilml import --init LOG... --out {path}")
    found = _take_map(settings, str(path))
    settings.finish()
    return found


def map_from(content: Mapping[str, Any]) -> LogMap:
    """A map from a dictionary with the content of the file; raises `InputError` likewise."""
    settings = Settings(dict(content), "map")
    found = _take_map(settings, "map")
    settings.finish()
    return found


def _take_map(settings: Settings, source: str) -> LogMap:
    files = _take_files(settings.table("files"))
    time = settings.table("time")
    time_column, time_unit = time.text("column", ""), time.text("unit", "s")
    rate = take_uncertain(time, "rate", "Hz", _ZERO).value
    time.finish()
    runs = settings.table("runs")
    run_column = runs.text("column", "")
    at_reset = bool(runs.take("split_where_time_restarts", bool, "true or false", False))
    each_struct = bool(runs.take("each_struct", bool, "true or false", False))
    each_row = bool(runs.take("each_row", bool, "true or false", False))
    pause = take_uncertain(runs, "split_at_pauses_over", "s", Uncertain(math.inf), 0.0).value
    runs.finish()
    vehicle = _take_vehicle(settings.table("vehicle")) if "vehicle" in settings else None
    shared_wheel = settings.table("wheel")
    radius = _take_radius(shared_wheel)
    pattern = _take_gear_pattern(shared_wheel)
    gear = shared_wheel.text("gear", "")
    shared_wheel.finish()
    leg = take_wheel_leg(settings.table("wheel_leg")) if "wheel_leg" in settings else None
    if leg is not None:
        if radius is not None or each_row:
            settings.fail("has [wheel_leg] beside [wheel] radius or [runs] each_row; remove one")
        radius = leg.length
    gears = _take_gears(settings)
    named = settings.table("wheels")
    defaults = shared_keys(settings, named.content)
    shared = _take_channels(settings, leg is not None)
    wheels = []
    for name in named.content:
        content = named.take(name, dict, f"a table [wheels.{name}]")
        own = Settings(
            with_shared_keys(content, defaults),
            f"{settings.where} [wheels.{name}]",
            settings.files,
        )
        own_pattern = _take_gear_pattern(own) or pattern
        own_gear = own.text("gear", gear)
        wheels.append(
            WheelMap(
                name,
                _take_radius(own) or gears.get(own_gear) or radius,
                shared | _take_channels(own, leg is not None),
                own_gear,
                _take_axle(own),
                own_pattern,
                leg,
            )
        )
        own.finish()
    if not wheels:
        wheels = [WheelMap("", gears.get(gear) or radius, shared, gear, "", pattern, leg)]
    for wheel in wheels:
        _check_wheel(settings, wheel, vehicle, bool(gears))
    return LogMap(
        source=source,
        wheels=tuple(wheels),
        files=files,
        time_column=time_column,
        time_unit=time_unit,
        rate=rate,
        run_column=run_column,
        split_at_reset=at_reset,
        each_struct=each_struct,
        split_at_pause=pause,
        vehicle=vehicle,
        windows=take_windows(settings.table("windows")),
        left_out=tuple(take_left_out(entry) for entry in settings.tables("leave_out")),
        each_row=each_row,
        gears=gears,
    )


def _take_gears(settings: Settings) -> dict[str, Uncertain]:
    """The radius of each gear of [gears.NAME], m."""
    named = settings.table("gears")
    found: dict[str, Uncertain] = {}
    for name in named.content:
        own = Settings(
            named.take(name, dict, f"a table [gears.{name}]"),
            f"{settings.where} [gears.{name}]",
            settings.files,
        )
        radius = _take_radius(own)
        if radius is not None:
            found[name] = radius
        else:
            own.fail("the radius is missing; needed is radius or diameter, such as '0.15 m +- 1 %'")
        own.finish()
    return found


def _take_channels(settings: Settings, with_legs: bool) -> dict[str, ChannelMap]:
    roles = (*ROLES, *LEG_ROLES) if with_legs else tuple(ROLES)
    settings.permit(roles)
    return {role: take_channel(settings.table(role), role) for role in roles if role in settings}


def _take_radius(settings: Settings) -> Uncertain | None:
    if "diameter" in settings:
        diameter = take_uncertain(settings, "diameter", "m", lower=0.0)
        return Uncertain(diameter.value / 2.0, diameter.std / 2.0)
    if "radius" in settings:
        return take_uncertain(settings, "radius", "m", lower=0.0)
    settings.permit(["radius", "diameter"])
    return None


def _take_gear_pattern(settings: Settings) -> re.Pattern[str] | None:
    if "gear_from" not in settings:
        settings.permit(["gear_from"])
        return None
    text = settings.text("gear_from")
    if "gear" in settings:
        settings.fail("has gear and gear_from; give one of them")
    try:
        pattern = re.compile(text, re.IGNORECASE)
    except re.error as error:
        settings.fail(f"gear_from {text!r} is no regular expression: {error}")
    if pattern.groups > 1:
        settings.fail(f"gear_from is {text!r}; needed is at most one group, the name of the gear")
    return pattern


def _take_axle(settings: Settings) -> str:
    axle = settings.text("axle", "")
    if axle not in ("", "front", "rear", "middle"):
        settings.fail(f"axle is {axle!r}; needed is 'front', 'middle' or 'rear'")
    return axle


def _take_files(settings: Settings) -> tuple[FileKind, ...]:
    kinds = []
    for name in settings.content:
        own = Settings(
            settings.take(name, dict, f"a table [files.{name}]"),
            f"{settings.where} [files.{name}]",
            settings.files,
        )
        pattern, clock, delay = own.text("pattern"), own.text("clock", "same"), 0.0
        if clock not in ("same", "start"):
            own.fail(f"clock is {clock!r}; needed is 'same' or 'start'")
        if "delay" in own:
            delay = take_uncertain(own, "delay", "s").value
        kinds.append(
            FileKind(
                name=name,
                pattern=pattern,
                clock=clock,
                delay=delay,
                time_column=own.text("time", ""),
                time_unit=own.text("time_unit", ""),
            )
        )
        own.finish()
    return tuple(kinds)


def _take_vehicle(settings: Settings) -> Vehicle:
    mass = take_uncertain(settings, "mass", "kg", lower=0.0)
    lengths = {
        key: take_uncertain(settings, key, "m", _ZERO)
        for key in ("wheelbase", "behind_front", "height")
    }
    gravity = take_uncertain(settings, "gravity", "m/s^2", Uncertain(9.80665), lower=0.0).value
    vehicle = Vehicle(mass, settings.count("wheels", 1), gravity, **lengths)
    settings.finish()
    return vehicle


def _check_wheel(
    settings: Settings, wheel: WheelMap, vehicle: Vehicle | None, with_gears: bool
) -> None:
    """Raise `InputError` where slip or load cannot follow from the channels of a wheel."""
    has = wheel.channels.keys()
    of = f" of the wheel {wheel.name!r}" if wheel.name else ""
    wheel_side, ground_side = (
        ("wheel_speed", "wheel_angle", "rim_speed"),
        ("ground_speed", "position"),
    )
    if "slip" not in has and wheel.leg is None:
        for needed, words in ((wheel_side, "rotation"), (ground_side, "travel")):
            if not has & {*needed}:
                settings.fail(
                    f"the {words}{of} is missing, from which slip follows; needed is one of "
                    f"{', '.join(f'[{n}]' for n in needed)}, or [slip]"
                )
        by_gear = with_gears and wheel.gear_pattern is not None
        if wheel.radius is None and "rim_speed" not in has and not by_gear:
            settings.fail(
                f"[wheel] radius{of} is missing; needed is the radius at which slip is defined, "
                "such as radius = '0.15 m +- 1 %'"
            )
    if "load" not in has and vehicle is None:
        settings.fail(
            f"the load{of} is missing; needed is [load] with a column or a value, or [vehicle] "
            "with mass and wheels"
        )
