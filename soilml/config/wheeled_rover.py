"""A rover by its wheels: places, loads on a slope, ruts; and what its drives report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.declared_settings import Key, Numbers, named_tables, take_declared
from soilml.io.toml_settings import Settings
from soilml.parameters import Parameter, check_number
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.model import Model

#: Gravity by name, m/s^2: standard gravity (BIPM 2019), and the equatorial surface values of the
#: Moon and Mars (NASA planetary fact sheets).
GRAVITY = {"earth": 9.80665, "moon": 1.62, "mars": 3.71}
#: Loads below this share of the mean one count as a wheel that leaves the ground.
LEAST_LOAD_SHARE = 1e-3


_GRAVITY = Parameter("m/s^2", 0.01, 30.0, "gravity")
_NEEDED = "a number in m/s^2, or one of earth, moon, mars"


def read_gravity(value: float | str, where: str = "") -> float:
    """Gravity (m/s^2) from a number or a name; raises `InputError` for another."""
    where = f"{where}: " if where else ""
    if isinstance(value, str):
        if value.lower() in GRAVITY:
            return GRAVITY[value.lower()]
        try:
            value = float(value)
        except ValueError:
            raise InputError(f"{where}gravity is {value!r}; needed is {_NEEDED}") from None
    check_number(f"{where}gravity", _GRAVITY, value)
    return float(value)


class GravityByName:
    """Gravity as a number or by name."""

    def take(self, settings: Settings, key: str, kind: str) -> float:
        """Gravity, m/s^2."""
        return read_gravity(settings.take(key, (int, float, str), _NEEDED), settings.where)


@dataclass(frozen=True)
class RoverWheel:
    """A wheel: place of its contact (m; forward, to the left), and its gear's name or None."""

    forward: float
    left: float
    gear: str | None = None


_LENGTHS = "in m, up to 100"


@dataclass(frozen=True)
class _WheelTable:
    """A wheel of [rover.wheels]."""

    position: Annotated[tuple[float, float], Numbers(f"[forward, left] {_LENGTHS}", 2, -100, 100)]
    gear: str = ""


class WheelsByName:
    """The tables [rover.wheels.NAME]."""

    def take(self, settings: Settings, key: str, kind: str) -> dict[str, RoverWheel]:
        """The wheels by name."""
        found = named_tables(settings, key, _WheelTable)
        return {n: RoverWheel(*wheel.position, wheel.gear or None) for n, wheel in found.items()}


@dataclass(frozen=True)
class WheeledRover:
    """Driven wheels under a rigid body; all rims have one speed, and so all wheels one slip.

    Raises `InputError` for fewer than two wheels, and a centre of mass below the ground.

    Examples
    --------
    >>> wheels = {"front": RoverWheel(0.5, 0.0), "rear": RoverWheel(-0.5, 0.0)}
    >>> rover = WheeledRover(10.0, (0.0, 0.0, 0.25), wheels, gravity=10.0)
    >>> rover.loads(0.0).round(1).tolist()  # N
    [50.0, 50.0]
    >>> rover.loads(np.deg2rad(20.0)).round(1).tolist()
    [38.4, 55.5]
    """

    mass: Annotated[float, Parameter("kg", 0.01, 1e5, "mass of the whole rover")]
    # Forward, to the left, and above the ground, m, in the frame of the wheels
    centre_of_mass: Annotated[
        tuple[float, float, float], Numbers(f"[forward, left, height] {_LENGTHS}", 3, -100, 100)
    ]
    wheels: Annotated[Mapping[str, RoverWheel], WheelsByName()]
    gravity: Annotated[float, GravityByName()] = GRAVITY["earth"]  # m/s^2

    def __post_init__(self) -> None:
        """Raise `InputError` for a rover that cannot stand."""
        if self.centre_of_mass[2] < 0.0:
            raise InputError(
                f"centre_of_mass is {list(self.centre_of_mass)!r}; its height above the ground "
                "cannot be negative"
            )
        if len(self.wheels) < 2:
            raise InputError(
                "[rover.wheels] needs two wheels or more, each as "
                "front-left = { position = [0.4, 0.3] }"
            )

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * self.gravity

    def loads(self, slope: Any, roll: Any = 0.0) -> Floats:
        r"""Load perpendicular to the ground on each wheel, N (wheels, ...), on a slope.

        .. math::
            \sum W_i = m g \cos\alpha \cos\rho, \quad
            \sum W_i x_i = m g (x_c \cos\alpha \cos\rho - h \sin\alpha), \quad
            \sum W_i y_i = m g \cos\alpha (y_c \cos\rho - h \sin\rho)

        with the pitch alpha up the slope, and the roll rho (0 straight up), positive where the left
        side is higher; at constant speed, with the offset of the wheel forces from the wheel's
        middle neglected. Of the loads that balance, those of the least sum of squares: those of
        equally stiff wheels under a rigid body. A suspension that shares the load otherwise is not
        described.

        Raises `InputError` where wheels in one line do not carry the moment, or a wheel would leave
        the ground.
        """
        slope, roll = np.broadcast_arrays(np.asarray(slope, dtype=np.float64), roll)
        x, y, height = self.centre_of_mass
        across, along = np.cos(slope) * np.cos(roll), np.sin(slope)
        aside = np.cos(slope) * np.sin(roll)
        places = np.asarray([(1.0, w.forward, w.left) for w in self.wheels.values()]).T
        needed = self.weight * np.stack(
            [across, x * across - height * along, y * across - height * aside]
        )
        loads = np.tensordot(np.linalg.pinv(places), needed, axes=1)
        missing = np.tensordot(places, loads, axes=1) - needed
        if np.abs(missing).max() > 1e-9 * self.weight * max(1.0, np.abs(places).max()):
            raise InputError(
                "[rover]: wheels in one line do not carry a centre of mass beside it; check "
                "centre_of_mass and the positions of the wheels"
            )
        least = LEAST_LOAD_SHARE * self.weight / len(self.wheels)
        for name, own in zip(self.wheels, loads, strict=True):
            if np.any(own < least):
                steepest = float(np.rad2deg(np.min(slope[own < least])))
                raise InputError(
                    f"[rover]: the wheel {name} leaves the ground on a slope of {steepest:.3g} "
                    "deg; check centre_of_mass and the positions of the wheels"
                )
        return np.asarray(loads)

    def tipping_slope(self, largest: float) -> float:
        """The slope (rad), up to `largest`, at which the first wheel leaves the ground."""
        low, high = 0.0, largest
        for _ in range(40):
            middle = 0.5 * (low + high)
            try:
                self.loads(middle)
            except InputError:
                high = middle
            else:
                low = middle
        return low

    def pass_numbers(self, width: Mapping[str, float]) -> dict[str, int]:
        """Pass of each wheel: 1, and 1 more for each wheel ahead of it whose rut it runs in.

        Ruts overlap by the `width` (m) of each wheel.
        """
        return {
            name: 1
            + sum(
                other.forward > wheel.forward
                and abs(other.left - wheel.left) < 0.5 * (width[name] + width[ahead])
                for ahead, other in self.wheels.items()
            )
            for name, wheel in self.wheels.items()
        }


def take_rover(settings: Settings, gears: Mapping[str, Model]) -> WheeledRover:
    """Read `[rover]`: mass, centre_of_mass, gravity and [rover.wheels].

    `gears` are the models of the file by name; a single one has the name "".

    Raises `InputError` for a missing or misspelt key, a value out of bounds, an unknown gear, a
    gear that is no rigid wheel, or fewer than two wheels.
    """
    if "wheels" not in settings and "radius" in settings:
        settings.fail(
            "a rover of four equal wheels is for soilml paper climb; here each wheel stands in "
            "[rover.wheels], as front-left = { position = [0.4, 0.3] }"
        )
    rover = take_declared(WheeledRover, settings)
    for name, wheel in rover.wheels.items():
        if wheel.gear and wheel.gear not in gears:
            known = ", ".join(filter(None, gears)) or "none; write [gears.NAME] in place of [gear]"
            settings.fail(f"wheel {name}: gear is {wheel.gear!r}; gears of this file: {known}")
        kind = gears[wheel.gear or next(iter(gears))].gear
        if not isinstance(kind, RigidWheel):
            settings.fail(
                f"wheel {name}: its gear is a {kind.name}, but [rover] shares the load among "
                "wheels that touch the ground at one place each; leave [rover] out, and ask for "
                "one gear with --load"
            )
    return rover


@dataclass(frozen=True)
class DriveErrors:
    """[drive]: constant of the motors, losses of the drives, and errors of the force balance.

    Standard deviations are those of errors that stay alike from row to row. `loss`, N m, is the
    friction between motor and wheel; the torque on the soil is the reading less it. `gain_std` is
    a share of the torque, in which errors of the model are. `pull_std` is a share of the weight.
    """

    torque_per_ampere: Annotated[
        float | None, Parameter("N m/A", 1e-6, 1e6, "torque at the wheel for each ampere")
    ] = None
    loss: Annotated[float, Key("loss_Nm"), Parameter("N m", 0.0, 1e5, "of each wheel")] = 0.0
    loss_std: Annotated[float, Key("loss_Nm_std"), Parameter("N m", 0.0, 1e5)] = 0.2
    gain_std: Annotated[float, Parameter("1", 0.0, 1.0, "share of the torque")] = 0.07
    # Constant error of the pitch, and of the pull
    pull_std: Annotated[float, Parameter("1", 1e-4, 1.0, "share of the weight")] = 0.015
    slope_std: Annotated[
        float, Key("slope_rad_std"), Parameter("rad", 0.0, 0.5, "error of the pitch of a row")
    ] = 0.005
    speed_std: Annotated[
        float, Key("rim_speed_std"), Parameter("1", 0.0, 0.2, "share of the rim speed of a row")
    ] = 0.005
