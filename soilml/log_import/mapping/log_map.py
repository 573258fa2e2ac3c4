"""A map: the file that says how a log is read."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from soilml.errors import InputError
from soilml.io.declared_settings import (
    For,
    Key,
    OneOf,
    named_tables,
    take_declared,
)
from soilml.io.toml_settings import Settings, read_settings
from soilml.log_import.mapping.channel_map import (
    LEG_ROLES,
    NOTHING,
    ROLES,
    ROTATIONS,
    TRAVELS,
    ChannelMap,
    Uncertain,
    UncertainIn,
)
from soilml.parameters import Parameter

#: Keys that say where samples come from, of which a table has one.
_SOURCES = ("column", "value", "file_name", "head")
_SECONDS = UncertainIn("s", exact=True)


@dataclass(frozen=True)
class FileKind:
    """One kind of file, where a run has several: its name has `pattern`; how its clock is read.

    `time_column` and `time_unit` replace those of [time] where they are not "".
    """

    name: str
    pattern: str
    clock: Annotated[str, OneOf(("same", "start"))] = "same"
    delay: Annotated[float, _SECONDS] = 0.0
    time_column: Annotated[str, Key("time")] = ""
    time_unit: str = ""


@dataclass(frozen=True)
class TimeMap:
    """[time]: the clock of the samples, a column or a rate in Hz."""

    column: str = ""
    unit: str = "s"
    rate: Annotated[float, UncertainIn("Hz", exact=True)] = 0.0


@dataclass(frozen=True)
class RunsMap:
    """[runs]: what divides a file into runs; whether each row is one already."""

    column: str = ""
    at_reset: Annotated[bool, Key("split_where_time_restarts")] = False
    each_struct: bool = False
    each_row: bool = False
    at_pause: Annotated[
        float, Key("split_at_pauses_over"), UncertainIn("s", above=0.0, exact=True)
    ] = math.inf  # s

    @property
    def by_time(self) -> bool:
        """Whether one file holds several runs, one after the other."""
        return self.at_reset or math.isfinite(self.at_pause)


@dataclass(frozen=True)
class Vehicle:
    """Masses and lengths from which the load of each wheel follows, in kg, m and m/s^2.

    `behind_front` is the distance of the centre of mass behind the front axle.
    """

    mass: Annotated[Uncertain, UncertainIn("kg", above=0.0)]
    wheels: int = 1
    gravity: Annotated[float, UncertainIn("m/s^2", above=0.0, exact=True)] = 9.80665
    wheelbase: Annotated[Uncertain, UncertainIn("m")] = NOTHING
    behind_front: Annotated[Uncertain, UncertainIn("m")] = NOTHING
    height: Annotated[Uncertain, UncertainIn("m")] = NOTHING


@dataclass(frozen=True)
class WindowSettings:
    """[windows]: how steady windows are found; times in s."""

    shortest: Annotated[float, UncertainIn("s", above=0.0, exact=True)] = 2.0
    settle: Annotated[float, _SECONDS] = 0.5
    sensitivity: Annotated[float, Parameter("1", 1e-9, 1e9, "2 finds smaller changes")] = 1.0


@dataclass(frozen=True)
class LeaveOut:
    """[[leave_out]]: a stretch of a run that the user leaves out, in s after its start."""

    run: str = ""
    start: Annotated[float, Key("from"), _SECONDS] = 0.0
    stop: Annotated[float, Key("until"), _SECONDS] = math.inf
    why: str = "left out by the map"


@dataclass(frozen=True)
class WheelLegMap:
    """[wheel_leg]: a wheel with legs, each stance of which is a row.

    length: From the axle to the end of a leg, m.
    zero: Angle at which a leg points straight down, rad.
    sensor_height: Height of the range-finder of [clearance] above the axle, m.
    half_width: Half of the angle around midstance over which sensors are averaged, rad.
    """

    legs: Annotated[int, Parameter("1", 3, 12, "how many legs it has")]
    length: Annotated[Uncertain, UncertainIn("m", above=0.0)]
    zero: Annotated[float, UncertainIn("rad", exact=True)]
    sensor_height: Annotated[Uncertain, UncertainIn("m")] = NOTHING
    half_width: Annotated[float, UncertainIn("rad", above=0.0, exact=True)] = 0.1

    def __post_init__(self) -> None:
        """Raise `InputError` for a width that reaches the neighbouring leg."""
        if not self.half_width < self.spacing / 4.0:
            raise InputError(
                f"half_width is {self.half_width:g} rad; needed is a number above 0 and below a "
                f"quarter of the {self.spacing:.3g} rad between legs"
            )

    @property
    def spacing(self) -> float:
        """Angle between neighbouring legs, rad: that of a stance."""
        return 2.0 * math.pi / self.legs


@dataclass(frozen=True)
class WheelKeys:
    """[wheel] and [wheels.NAME]: radius and gear."""

    radius: Annotated[Uncertain | None, UncertainIn("m", above=0.0)] = None
    diameter: Annotated[Uncertain | None, UncertainIn("m", above=0.0)] = None
    gear: str = ""
    axle: Annotated[str, For(("wheel",)), OneOf(("front", "middle", "rear", ""))] = ""

    @property
    def size(self) -> Uncertain | None:
        """The radius, m; None where the table has none."""
        return self.radius if self.diameter is None else self.diameter.times(0.5)


@dataclass(frozen=True)
class WheelMap:
    """A wheel: its radius (m), its channels by role, its gear, and where it stands."""

    name: str
    radius: Uncertain | None
    channels: dict[str, ChannelMap]
    gear: str = ""
    axle: str = ""
    leg: WheelLegMap | None = None  # Where the wheel has legs: each stance is a row


@dataclass(frozen=True)
class LogMap:
    """How a log is read; see docs/how-to/import.md for the file."""

    source: str
    wheels: tuple[WheelMap, ...] = ()
    files: tuple[FileKind, ...] = ()
    time: TimeMap = field(default_factory=TimeMap)
    runs: RunsMap = field(default_factory=RunsMap)
    vehicle: Vehicle | None = None
    windows: WindowSettings = field(default_factory=WindowSettings)
    left_out: tuple[LeaveOut, ...] = ()


def read_map(path: str | os.PathLike[str]) -> LogMap:
    """Read a map; raises `InputError`, naming file, table and key, for what is wrong in it."""
    return _take_map(read_settings(path, f"soilml import --init LOG... --out {path}"))


def map_from(content: Mapping[str, Any], source: str = "map") -> LogMap:
    """A map from a dictionary with the content of the file; raises `InputError` likewise."""
    return _take_map(Settings(dict(content), source))


def _take_map(settings: Settings) -> LogMap:
    files = named_tables(settings, "files", FileKind)
    time = take_declared(TimeMap, settings.table("time"))
    runs = take_declared(RunsMap, settings.table("runs"))
    vehicle = leg = None
    if "vehicle" in settings:
        vehicle = take_declared(Vehicle, settings.table("vehicle"))
    common = take_declared(WheelKeys, settings.table("wheel"))
    radius = common.size
    if "wheel_leg" in settings:
        leg = take_declared(WheelLegMap, settings.table("wheel_leg"))
        if radius is not None or runs.each_row:
            settings.fail("has [wheel_leg] beside [wheel] radius or [runs] each_row; remove one")
        radius = leg.length
    named = settings.table("wheels")
    own_tables = _with_shared_keys(settings, named.content)
    shared = _take_channels(settings, leg is not None)
    wheels = []
    for name in named.content or ("",):
        channels, keys = shared, WheelKeys()
        if name:
            own = Settings(own_tables.get(name, {}), named.table(name).where, settings.folder)
            channels = shared | _take_channels(own, leg is not None)
            keys = take_declared(WheelKeys, own, "wheel")
        size, gear = keys.size or radius, keys.gear or common.gear
        wheels.append(WheelMap(name, size, channels, gear, keys.axle, leg))
    for wheel in wheels:
        _check_wheel(settings, wheel, vehicle)
    found = LogMap(
        source=settings.where,
        wheels=tuple(wheels),
        files=tuple(files.values()),
        time=time,
        runs=runs,
        vehicle=vehicle,
        windows=take_declared(WindowSettings, settings.table("windows")),
        left_out=tuple(take_declared(LeaveOut, one) for one in settings.tables("leave_out")),
    )
    settings.finish()
    return found


def _with_shared_keys(settings: Settings, wheels: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The tables of the wheels, with the keys of tables outside that their channels do not state.

    One outside that names no source of samples is taken out of `settings`: it serves wheels only.
    """
    found = {name: dict(own) for name, own in wheels.items() if isinstance(own, dict)}
    for role in ROLES:
        shared = settings.content.get(role)
        users = [own for own in found.values() if isinstance(own.get(role), dict)]
        if not users or not isinstance(shared, dict):
            continue
        if not {*_SOURCES} & shared.keys():
            settings.take(role, dict, f"a table [{role}]")
        for own in users:
            left_out = _SOURCES if {*_SOURCES} & own[role].keys() else ()
            own[role] = {k: v for k, v in shared.items() if k not in left_out} | own[role]
    return found


def _take_channels(settings: Settings, with_legs: bool) -> dict[str, ChannelMap]:
    roles = (*ROLES, *LEG_ROLES) if with_legs else tuple(ROLES)
    settings.permit(roles)
    return {
        role: take_declared(ChannelMap, settings.table(role), role, role=role)
        for role in roles
        if role in settings
    }


def _check_wheel(settings: Settings, wheel: WheelMap, vehicle: Vehicle | None) -> None:
    """Raise `InputError` where slip or load cannot follow from the channels of a wheel."""
    has = wheel.channels.keys()
    of = f" of the wheel {wheel.name!r}" if wheel.name else ""
    if "slip" not in has and wheel.leg is None:
        for needed, words in ((ROTATIONS, "rotation"), (TRAVELS, "travel")):
            if not has & {*needed}:
                settings.fail(
                    f"the {words}{of} is missing, from which slip follows; needed is one of "
                    f"{', '.join(f'[{n}]' for n in needed)}, or [slip]"
                )
        if wheel.radius is None and "rim_speed" not in has:
            settings.fail(
                f"[wheel] radius{of} is missing; needed is the radius at which slip is defined, "
                "such as radius = '0.15 m +- 1 %'"
            )
    if "load" not in has and vehicle is None:
        settings.fail(
            f"the load{of} is missing; needed is [load] with a column or a value, or [vehicle] "
            "with mass and wheels"
        )
