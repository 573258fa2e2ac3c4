"""One channel of a map: where its samples are, their unit, sign, tare and errors."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from soilml.config.measurement_noise import Noise, take_share_and_constant
from soilml.io.toml_settings import Settings
from soilml.log_import.mapping.uncertain_value import Uncertain, take_uncertain
from soilml.log_import.units import dimension, factor

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
#: Channels that an encoder before the gearbox, or a motor, may give.
GEARED = ("wheel_speed", "wheel_angle", "torque", "motor_current")
#: What a log may call slip: ours; the ratio of travel to rim speed; (r omega - v) / v.
SLIP_DEFINITIONS = ("1 - v/(r omega)", "v/(r omega)", "(r omega - v)/v")
#: How many columns a channel may have, where more than one: x, y, z; cells that are added up;
#: sensors of which the mean is taken.
_SEVERAL: dict[str, Sequence[int]] = {
    "position": (1, 2, 3), "slope": (1, 3, 4), "load": range(1, 9), "drawbar_pull": range(1, 9),
    "sinkage": range(1, 5),
}  # fmt: skip
_EXACT, _NOTHING = Uncertain(1.0), Uncertain(0.0)
_NEEDED = "a number, '2 %' of the reading, or '2 % + 0.05'"


@dataclass(frozen=True)
class ChannelMap:
    """A channel of a map.

    role: Key of `UNITS`.
    columns: Columns of the log; empty for a constant and for a number in the name of the file.
    scale: What samples are multiplied by to be in the unit of soilml, with sign.
    has_scale: Whether the map states that scale, or counts of a turn, in place of a unit.
    tare: Stretch in which the sensor should read zero: (from, until) in s after the start of a run,
        or "rest" for the time before the wheel starts; None where it is not tared.
    bias, noise: Errors that all rows share, and errors of each row beside its scatter.
    value: A constant; None where it is measured.
    name_pattern, head_pattern: Regular expression whose group 1 is the number in the name of the
        file or run; in a line before the header of the file.
    gear_ratio, efficiency, torque_constant, idle_current: What stands between motor and wheel; the
        ratio is turns of the motor for one of the wheel.
    unwrap: Range of an angle or counter that starts again at 0, in the log's unit; 0 where it does
        not.
    std_column, std_scale, std_is_share: Column with the standard error of each row, where each row
        is a steady run; what its values are multiplied by to be in the unit of soilml, or to be
        shares of the reading.
    definition: What a slip that the log has is: one of `SLIP_DEFINITIONS`.
    """

    role: str
    columns: tuple[str, ...] = ()
    scale: float = 1.0
    unit: str = ""
    tare: str | tuple[float, float] | None = None
    bias: Noise = field(default_factory=Noise)
    noise: Noise = field(default_factory=Noise)
    value: Uncertain | None = None
    name_pattern: re.Pattern[str] | None = None
    gear_ratio: Uncertain = _EXACT
    efficiency: Uncertain = _EXACT
    torque_constant: Uncertain = _EXACT
    idle_current: Uncertain = _NOTHING
    unwrap: float = 0.0
    definition: str = SLIP_DEFINITIONS[0]
    head_pattern: re.Pattern[str] | None = None
    std_column: str = ""
    std_scale: float = 1.0
    std_is_share: bool = False
    has_scale: bool = False

    @property
    def where(self) -> str:
        """The table of the map, for messages."""
        return f"[{self.role}]"


def take_channel(settings: Settings, role: str) -> ChannelMap:
    """Read the table of a channel; raises `InputError` for what is missing, unknown or wrong."""
    ours = UNITS[role]
    where = settings.where
    columns = _columns(settings, role)
    pattern = _pattern(settings, "file_name", columns)
    head_pattern = _pattern(settings, "head", columns)
    value = None
    if not columns and pattern is None and head_pattern is None:
        if "value" not in settings:
            settings.fail(
                "needed is column = 'NAME', value = a constant, file_name = a pattern such as "
                "'load_(\\d+)N', or head = one for a line before the header"
            )
        value = take_uncertain(settings, "value", ours)
    unit = settings.text("unit", "")
    scale, gain = 1.0, 0.0
    has_scale = bool({"scale", "counts_per_turn"} & settings.content.keys())
    if "scale" in settings:
        one = take_uncertain(settings, "scale", ours)
        scale, gain = one.value, one.relative
        if scale == 0.0 or "counts_per_turn" in settings:
            settings.fail("needed is a scale other than 0, and no counts_per_turn beside it")
    elif "counts_per_turn" in settings:
        turn = take_uncertain(settings, "counts_per_turn", "1", lower=0.0).value
        if dimension(unit or "count") not in ("count", "count/s"):
            settings.fail(f"counts_per_turn is given, and unit is {unit!r}; needed is 'count'")
        scale = 2.0 * math.pi / turn
    elif role == "slope" and len(columns) > 1:
        scale = 1.0  # an angle, whatever the unit of accelerations
    else:
        scale = factor(unit, ours, where)
    if settings.take("reverse", bool, "true or false", False):
        scale = -scale
    own = {}
    if role in GEARED:
        own["gear_ratio"] = take_uncertain(settings, "gear_ratio", "1", _EXACT, lower=0.0)
    if role in ("torque", "motor_current"):
        own["efficiency"] = take_uncertain(settings, "efficiency", "1", _EXACT, lower=0.0)
        if own["efficiency"].value > 1.0:
            settings.fail(f"efficiency is {own['efficiency'].value:g}; needed is 1 or less")
    if role == "motor_current":
        own["torque_constant"] = take_uncertain(settings, "torque_constant", "N m/A", lower=0.0)
        own["idle_current"] = take_uncertain(settings, "idle_current", "A", _NOTHING)
    unwrap = settings.number("wraps_at", 0.0) if role == "wheel_angle" else 0.0
    std_column, std_scale, is_share = _std(settings, role, unit, scale)
    bias = _error(settings, "bias")
    channel = ChannelMap(
        role=role,
        columns=columns,
        scale=scale,
        unit=unit,
        tare=_tare(settings),
        bias=replace(bias, share=math.hypot(bias.share, gain)),
        noise=_error(settings, "noise"),
        value=value,
        name_pattern=pattern,
        unwrap=unwrap,
        definition=_definition(settings, role),
        head_pattern=head_pattern,
        std_column=std_column,
        std_scale=std_scale,
        std_is_share=is_share,
        has_scale=has_scale,
        **own,
    )
    settings.finish()
    return channel


def _columns(settings: Settings, role: str) -> tuple[str, ...]:
    if "column" not in settings:
        settings.permit(["column"])
        return ()
    needed = "the name of a column in quotes, or a list of them"
    given = settings.take("column", (str, list), needed)
    names = [given] if isinstance(given, str) else given
    several = _SEVERAL.get(role, (1,))
    if len(names) not in several or not all(isinstance(name, str) and name for name in names):
        settings.fail(
            f"column is {given!r}; needed is {needed if len(several) > 1 else needed[:32]}"
        )
    return tuple(names)


def _std(settings: Settings, role: str, unit: str, scale: float) -> tuple[str, float, bool]:
    """Column of the standard errors, their scale, and whether they are shares of the reading."""
    column = settings.text("std", "")
    own = settings.text("std_unit", unit)
    ours = UNITS[role]
    if dimension(own) == "1" != ours:
        return column, factor(own, "1", f"{settings.where} std_unit"), True
    if own == unit:
        return column, abs(scale), False
    return column, factor(own, ours, f"{settings.where} std_unit"), False


def _definition(settings: Settings, role: str) -> str:
    if role != "slip":
        return SLIP_DEFINITIONS[0]
    given = settings.text("definition", SLIP_DEFINITIONS[0])
    for known in SLIP_DEFINITIONS:
        if given.replace(" ", "") == known.replace(" ", ""):
            return known
    shown = ", ".join(repr(known) for known in SLIP_DEFINITIONS)
    settings.fail(f"definition is {given!r}; needed is one of {shown}")
    return ""


def _pattern(settings: Settings, key: str, columns: tuple[str, ...]) -> re.Pattern[str] | None:
    if key not in settings:
        settings.permit([key])
        return None
    text = settings.text(key)
    if columns:
        settings.fail(f"has column and {key}; give one of them")
    try:
        pattern = re.compile(text, re.IGNORECASE)
    except re.error as error:
        settings.fail(f"{key} {text!r} is no regular expression: {error}")
    if pattern.groups != 1:
        settings.fail(f"{key} is {text!r}; needed is one group in brackets, the number")
    return pattern


def _tare(settings: Settings) -> str | tuple[float, float] | None:
    if "tare" not in settings:
        settings.permit(["tare"])
        return None
    needed = "'rest', or two times in s after the start of a run, such as [0.5, 3.0]"
    given = settings.take("tare", (str, list), needed)
    if given == "rest":
        return "rest"
    number = isinstance(given, list) and all(
        isinstance(x, int | float) and not isinstance(x, bool) for x in given
    )
    if not number or len(given) != 2 or not given[0] < given[1]:
        settings.fail(f"tare is {given!r}; needed is {needed}")
    return float(given[0]), float(given[1])


def _error(settings: Settings, key: str) -> Noise:
    if key not in settings:
        settings.permit([key])
        return Noise()
    share, constant = take_share_and_constant(settings, key, _NEEDED)
    return Noise(constant=constant, share=share)
