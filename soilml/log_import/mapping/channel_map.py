"""One channel of a map: where its samples are, their unit, sign, tare and errors; values with unit
and standard deviation: `\"38.5 mN m/A +- 3 %\"`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

from soilml.config.measurement_noise import Noise, NoiseOfReading
from soilml.errors import InputError
from soilml.io.cell_text import read_number
from soilml.io.declared_settings import For, Key, Numbers, OneOf, Pattern
from soilml.io.toml_settings import Settings
from soilml.log_import.units import dimension, factor

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_FORM = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*(?:(?:\+-|\+/-|±)\s*({_NUMBER})\s*(.*?))?\s*")


@dataclass(frozen=True)
class Uncertain:
    """A value in the unit of soilml, and its standard deviation; 0 where it is exact."""

    value: float
    std: float = 0.0

    @property
    def relative(self) -> float:
        """Standard deviation as a share of the value."""
        return self.std / abs(self.value) if self.value else 0.0

    def times(self, share: float) -> Uncertain:
        """The value and its standard deviation, multiplied."""
        return Uncertain(share * self.value, share * self.std)


@dataclass(frozen=True)
class UncertainIn:
    """A number or a text such as `"0.15 m +- 1 %"`, above `above`; without its error if `exact`.

    `unit` is that of soilml; "" for the unit of the channel.
    """

    unit: str = ""
    above: float = -math.inf
    exact: bool = False

    def take(self, settings: Settings, key: str, kind: str) -> Any:
        """The value; raises `InputError` for a wrong form and for one that is too small."""
        unit = self.unit or UNITS[kind]
        example = f"'0.15 {unit} +- 1 %'" if unit != "1" else "'0.7 +- 0.05'"
        needed = f"a number in {unit}, or a text such as {example}"
        given = settings.take(key, (int, float, str), needed)
        found = parse_uncertain(given, unit, f"{settings.where} {key}")
        if found is None or found.std < 0.0:
            settings.fail(f"{key} is {given!r}; needed is {needed}")
        if not found.value > self.above:
            settings.fail(f"{key} is {given!r}; needed is a value above {self.above:g}")
        return found.value if self.exact else found


def parse_uncertain(text: str | int | float, ours: str, where: str) -> Uncertain | None:
    """A number, or a text such as `"0.15 m +- 1 %"`; None for another form.

    The standard deviation is in the value's own unit, in another one, or in per cent of the value.
    Raises `InputError` for a unit that does not give `ours`.
    """
    if not isinstance(text, str):
        return Uncertain(float(text)) if math.isfinite(text) else None
    match = _FORM.fullmatch(text)
    if match is None:
        return None
    try:
        number, std = read_number(match[1]), read_number(match[3] or "0")
    except ValueError:  # more than a number can hold
        return None
    scale, unit = factor(match[2], ours, where), match[4]
    value, size = number * scale, scale
    if unit == "%" and match[2] != "%":
        size = abs(value) / 100.0
    elif unit:
        size = factor(unit, ours, where)
    return Uncertain(value, std * size)


#: Unit of soilml of each channel that a map may have, and what it is.
ROLES: dict[str, tuple[str, str]] = {
    "wheel_speed": ("rad/s", "rotation speed of the wheel, or of its motor"),
    "wheel_angle": ("rad", "angle of the wheel, or of its motor, or counts of an encoder"),
    "rim_speed": ("m/s", "speed of the rim, r omega"),
    "ground_speed": ("m/s", "travel speed of the axle"),
    "position": ("m", "place along the travel; two or three columns for x, y, z"),
    "slip": ("1", "slip, where the log has it already"),
    "torque": ("N m", "torque from a sensor"),
    "motor_current": ("A", "current of the motor, from which the torque follows"),
    "load": ("N", "vertical load on the wheel"),
    "drawbar_pull": ("N", "pull of the wheel on its axle"),
    "sinkage": ("m", "sinkage of the wheel"),
    "slope": ("rad", "slope of the ground, positive uphill; or accelerations, or a quaternion"),
}
#: Channels that only a wheel-leg has: maps with the table [wheel_leg].
LEG_ROLES: dict[str, tuple[str, str]] = {
    "vibration": ("m/s^2", "vertical acceleration of the hub, positive upward"),
    "clearance": ("m", "distance from a range-finder straight down to the ground"),
}
UNITS = {role: unit for role, (unit, _) in (ROLES | LEG_ROLES).items()}
#: Channels from which slip follows: rotation and travel, the better one first.
ROTATIONS, TRAVELS = ("rim_speed", "wheel_angle", "wheel_speed"), ("position", "ground_speed")
#: Channels that an encoder before the gearbox, or a motor, may give.
GEARED = ("wheel_speed", "wheel_angle", "torque", "motor_current")
_TORQUES, _CURRENT = For(("torque", "motor_current")), For(("motor_current",))
#: What a log may call slip: ours; the ratio of travel to rim speed; (r omega - v) / v.
SLIP_DEFINITIONS = ("1 - v/(r omega)", "v/(r omega)", "(r omega - v)/v")
#: How many columns a channel may have, where more than one: x, y, z; cells that are added up;
#: sensors of which the mean is taken.
_SEVERAL: dict[str, Sequence[int]] = {
    "position": (1, 2, 3), "slope": (1, 3, 4), "load": range(1, 9), "drawbar_pull": range(1, 9),
    "sinkage": range(1, 5),
}  # fmt: skip
EXACT, NOTHING = Uncertain(1.0), Uncertain(0.0)
_ERROR = NoiseOfReading("a number, '2 %' of the reading, or '2 % + 0.05'")
_REST = "'rest', or two times in s after the start of a run, such as [0.5, 3.0]"


class _Columns:
    """The name of a column, or several where the role has them."""

    def take(self, settings: Settings, key: str, role: str) -> tuple[str, ...]:
        needed = "the name of a column in quotes, or a list of them"
        given = settings.take(key, (str, list), needed)
        names = [given] if isinstance(given, str) else given
        several = _SEVERAL.get(role, (1,))
        if len(names) not in several or not all(isinstance(name, str) and name for name in names):
            needed = needed if len(several) > 1 else needed[:32]
            settings.fail(f"{key} is {given!r}; needed is {needed}")
        return tuple(names)


@dataclass(frozen=True)
class ChannelMap:
    """A channel of a map; the fields are the keys of its table.

    role: Key of `UNITS`.
    columns: Columns of the log; empty for a constant and for a number in the name of the file.
    value: A constant; None where it is measured.
    name_pattern, head_pattern: Regular expression whose group 1 is the number in the name of the
        file or run; in a line before the header of the file.
    unit, one: Unit of the samples; or what 1 of them is, as a calibration states it.
    tare: Stretch in which the sensor should read zero: (from, until) in s after the start of a run,
        or "rest" for the time before the wheel starts; None where it is not tared.
    shared, noise: Errors that all rows share, and errors of each row beside its scatter.
    gear_ratio, efficiency, torque_constant, idle_current: What stands between motor and wheel; the
        ratio is turns of the motor for one of the wheel.
    unwrap: Range of an angle or counter that starts again at 0, in the log's unit; 0 where it does
        not.
    definition: What a slip that the log has is: one of `SLIP_DEFINITIONS`.
    std_column, std_unit: Column with the standard error of each row, where each row is a steady
        run; its unit, where it is not that of the samples.
    """

    role: str
    columns: Annotated[tuple[str, ...], Key("column"), _Columns()] = ()
    value: Annotated[Uncertain | None, UncertainIn()] = None
    name_pattern: Annotated[
        re.Pattern[str] | None, Key("file_name"), Pattern((1, 1), "the number")
    ] = None
    head_pattern: Annotated[re.Pattern[str] | None, Key("head"), Pattern((1, 1), "the number")] = (
        None
    )
    unit: str = ""
    one: Annotated[Uncertain | None, Key("scale"), UncertainIn()] = None
    counts_per_turn: Annotated[float, UncertainIn("1", above=0.0, exact=True)] = 0.0
    reverse: bool = False
    tare: Annotated[
        str | tuple[float, float] | None, Numbers(_REST, 2, rising=True, also=("rest",))
    ] = None
    shared: Annotated[Noise, Key("bias"), _ERROR] = field(default_factory=Noise)
    noise: Annotated[Noise, _ERROR] = field(default_factory=Noise)
    gear_ratio: Annotated[Uncertain, For(GEARED), UncertainIn("1", above=0.0)] = EXACT
    efficiency: Annotated[Uncertain, _TORQUES, UncertainIn("1", above=0.0)] = EXACT
    torque_constant: Annotated[Uncertain | None, _CURRENT, UncertainIn("N m/A", above=0.0)] = None
    idle_current: Annotated[Uncertain, _CURRENT, UncertainIn("A")] = NOTHING
    unwrap: Annotated[
        float, Key("wraps_at"), For(("wheel_angle",)), UncertainIn("1", exact=True)
    ] = 0.0
    definition: Annotated[str, For(("slip",)), OneOf(SLIP_DEFINITIONS)] = SLIP_DEFINITIONS[0]
    std_column: Annotated[str, Key("std")] = ""
    std_unit: str = ""

    def __post_init__(self) -> None:
        """Raise `InputError` for keys that do not go together."""
        sources = {"column": self.columns, "value": self.value, "file_name": self.name_pattern,
                   "head": self.head_pattern}  # fmt: skip
        given = [key for key, source in sources.items() if source]
        if not given:
            raise InputError(
                "needed is column = 'NAME', value = a constant, file_name = a pattern such as "
                "'load_(\\d+)N', or head = one for a line before the header"
            )
        if len(given) > 1:
            raise InputError(f"has {given[0]} and {given[1]}; give one of them")
        if self.one is not None and (self.one.value == 0.0 or self.counts_per_turn):
            raise InputError("needed is a scale other than 0, and no counts_per_turn beside it")
        if self.counts_per_turn and dimension(self.unit or "count") not in ("count", "count/s"):
            raise InputError(f"counts_per_turn is given, and unit is {self.unit!r}; needed is "
                             "'count'")  # fmt: skip
        if self.efficiency.value > 1.0:
            raise InputError(f"efficiency is {self.efficiency.value:g}; needed is 1 or less")
        if self.role == "motor_current" and self.torque_constant is None:
            raise InputError(
                "torque_constant is missing; needed is a number in N m/A, or a text such as "
                "'0.15 N m/A +- 1 %'"
            )
        self.scale, self.std_scale  # noqa: B018  (which raise for a unit of another kind)

    @property
    def where(self) -> str:
        """The table of the map, for messages."""
        return f"[{self.role}]"

    @property
    def has_scale(self) -> bool:
        """Whether the map states a scale, or counts of a turn, in place of a unit."""
        return self.one is not None or bool(self.counts_per_turn)

    @cached_property
    def scale(self) -> float:
        """What samples are multiplied by to be in the unit of soilml, with sign."""
        if self.one is not None:
            size = self.one.value
        elif self.counts_per_turn:
            size = 2.0 * math.pi / self.counts_per_turn
        elif self.role == "slope" and len(self.columns) > 1:
            size = 1.0  # an angle, whatever the unit of accelerations
        else:
            size = factor(self.unit, UNITS[self.role])
        return -size if self.reverse else size

    @property
    def bias(self) -> Noise:
        """The errors that all rows share, with that of the scale."""
        gain = 0.0 if self.one is None else self.one.relative
        return replace(self.shared, share=math.hypot(self.shared.share, gain))

    @property
    def std_is_share(self) -> bool:
        """Whether the standard errors are shares of the reading."""
        return dimension(self.std_unit or self.unit) == "1" != UNITS[self.role]

    @cached_property
    def std_scale(self) -> float:
        """What standard errors are multiplied by to be in the unit of soilml, or to be shares."""
        if self.std_is_share:
            return factor(self.std_unit or self.unit, "1", "std")
        if self.std_unit in ("", self.unit):
            return abs(self.scale)
        return factor(self.std_unit, UNITS[self.role], "std")
