"""A rover by its wheels: places, loads on a slope, ruts; and what its drives report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.toml_settings import Settings
from soilml.parameters import Parameter
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.model import Model

#: Gravity by name, m/s^2: standard gravity (BIPM 2019), and the equatorial surface values of the
#: Moon and Mars (NASA planetary fact sheets).
GRAVITY = {"earth": 9.80665, "moon": 1.62, "mars": 3.71}
#: Loads below this share of the mean one count as a wheel that leaves the ground.
LEAST_LOAD_SHARE = 1e-3


@dataclass(frozen=True)
class RoverWheel:
    """A wheel: place of its contact (m; forward, to the left), and its gear's name or None."""

    forward: float
    left: float
    gear: str | None = None


@dataclass(frozen=True)
class WheeledRover:
    """Driven wheels under a rigid body; all rims have one speed, and so all wheels one slip.

    Examples
    --------
    >>> wheels = {"front": RoverWheel(0.5, 0.0), "rear": RoverWheel(-0.5, 0.0)}
    >>> rover = WheeledRover(10.0, (0.0, 0.0, 0.25), wheels, gravity=10.0)
    >>> rover.loads(0.0).round(1).tolist()  # N
    [50.0, 50.0]
    >>> rover.loads(np.deg2rad(20.0)).round(1).tolist()
    [38.4, 55.5]
    """

    mass: float  # Of the whole rover, kg
    # Forward, to the left, and above the ground, m, in the frame of the wheels
    centre_of_mass: tuple[float, float, float]
    wheels: Mapping[str, RoverWheel]  # By name
    gravity: float = GRAVITY["earth"]  # m/s^2

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
                low = middle
            except InputError:
                high = middle
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


_MASS = Parameter("kg", 0.01, 1e5, "mass of the whole rover")
_GRAVITY = Parameter("m/s^2", 0.01, 30.0, "gravity")


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
    mass = _bounded(settings, "mass", settings.number("mass"), _MASS)
    centre = _place(settings, "centre_of_mass", 3, "[forward, left, height] in m")
    if centre[2] < 0.0:
        settings.fail(
            f"centre_of_mass is {list(centre)!r}; its height above the ground cannot be negative"
        )
    gravity = read_gravity(settings.take("gravity", (int, float, str), _NEEDED, "earth"), settings)
    entries = settings.table("wheels")
    wheels = {}
    for name in entries.content:
        own = entries.table(name)
        forward, left = _place(own, "position", 2, "[forward, left] in m")
        gear = own.text("gear", "") or None
        if gear is not None and gear not in gears:
            known = ", ".join(filter(None, gears)) or "none; write [gears.NAME] in place of [gear]"
            own.fail(f"gear is {gear!r}; gears of this file: {known}")
        kind = gears[gear or next(iter(gears))].gear
        if not isinstance(kind, RigidWheel):
            own.fail(
                f"its gear is a {kind.name}, but [rover] shares the load among wheels that touch "
                "the ground at one place each; leave [rover] out, and ask for one gear with --load"
            )
        own.finish()
        wheels[name] = RoverWheel(forward, left, gear)
    if len(wheels) < 2:
        settings.fail(
            "[rover.wheels] needs two wheels or more, each as "
            "front-left = { position = [0.4, 0.3] }"
        )
    settings.finish()
    return WheeledRover(mass, (centre[0], centre[1], centre[2]), wheels, gravity)


_NEEDED = "a number in m/s^2, or one of earth, moon, mars"


def read_gravity(value: float | str, settings: Settings | None = None) -> float:
    """Gravity (m/s^2) from a number or a name; raises `InputError` for another."""
    where = f"{settings.where}: " if settings is not None else ""
    if isinstance(value, str):
        if value.lower() in GRAVITY:
            return GRAVITY[value.lower()]
        try:
            value = float(value)
        except ValueError:
            raise InputError(f"{where}gravity is {value!r}; needed is {_NEEDED}") from None
    if not _GRAVITY.lower <= value <= _GRAVITY.upper:
        raise InputError(
            f"{where}gravity is {value:g} m/s^2; needed is {_GRAVITY.lower:g} to {_GRAVITY.upper:g}"
        )
    return float(value)


def _bounded(settings: Settings, key: str, value: float, bounds: Parameter) -> float:
    if not bounds.lower <= value <= bounds.upper:
        settings.fail(
            f"{key} is {value:g} {bounds.unit}; needed is {bounds.lower:g} to {bounds.upper:g}"
        )
    return value


def _place(settings: Settings, key: str, count: int, needed: str) -> tuple[float, ...]:
    values = settings.take(key, list, needed)
    numbers = [v for v in values if isinstance(v, (int, float)) and not isinstance(v, bool)]
    if len(values) != count or len(numbers) != count or not np.isfinite(numbers).all():
        settings.fail(f"{key} is {values!r}; needed is {needed}")
    if max(abs(v) for v in numbers) > 100.0:
        settings.fail(f"{key} is {values!r}; needed are lengths in m, up to 100")
    return tuple(float(v) for v in numbers)


@dataclass(frozen=True)
class DriveErrors:
    """Constant of the motors, losses of the drives, and errors of the force balance.

    Standard deviations are those of errors that stay alike from row to row. `loss`, N m, is the
    friction between motor and wheel; the torque on the soil is the reading less it. `gain_std` is
    a share of the torque, in which errors of the model are. `pull_std` is a share of the weight.
    """

    torque_per_ampere: float | None = None  # N m at the wheel for each ampere
    loss: float = 0.0  # N m, of each wheel
    loss_std: float = 0.2  # N m
    gain_std: float = 0.07
    pull_std: float = 0.015  # Constant error of the pitch, and of the pull
    slope_std: float = 0.005  # rad, error of the pitch of a row
    speed_std: float = 0.005  # Error of the rim speed of a row, as a share of it


#: Key of each field of `DriveErrors` in the file.
DRIVE_KEYS = {
    "torque_per_ampere": "torque_per_ampere",
    "loss": "loss_Nm",
    "loss_std": "loss_Nm_std",
    "gain_std": "gain_std",
    "pull_std": "pull_std",
    "slope_std": "slope_rad_std",
    "speed_std": "rim_speed_std",
}


def take_drive(settings: Settings) -> DriveErrors:
    """Read `[drive]`; every key may be left out.

    Raises `InputError` for an unknown key or a value out of bounds.
    """
    known = DriveErrors()
    constant = None
    if "torque_per_ampere" in settings:
        constant = _number(settings, "torque_per_ampere", 0.0, 1e-6, 1e6, "N m/A")
    found = DriveErrors(
        constant,
        _number(settings, "loss_Nm", known.loss, 0.0, 1e5, "N m"),
        _number(settings, "loss_Nm_std", known.loss_std, 0.0, 1e5, "N m"),
        _number(settings, "gain_std", known.gain_std, 0.0, 1.0, "as a share of the torque"),
        _number(settings, "pull_std", known.pull_std, 1e-4, 1.0, "as a share of the weight"),
        _number(settings, "slope_rad_std", known.slope_std, 0.0, 0.5, "rad"),
        _number(settings, "rim_speed_std", known.speed_std, 0.0, 0.2, "as a share of the speed"),
    )
    settings.finish()
    return found


def _number(
    settings: Settings, key: str, default: float, low: float, high: float, unit: str
) -> float:
    value = settings.number(key, default)
    if not low <= value <= high:
        settings.fail(f"{key} is {value:g}; needed is a number from {low:g} to {high:g}, {unit}")
    return value
