"""Slip, torque, load and the other quantities of a wheel from its channels and the map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.mapping.channel_map import GEARED
from soilml.log_import.mapping.log_map import Vehicle, WheelMap
from soilml.log_import.mapping.uncertain_value import Uncertain

Constants = Callable[[str], float]  # Value of a constant of the map by name, such as "vehicle.mass"


@dataclass(frozen=True)
class Conversion:
    """From channels of a wheel to its quantities, by the constants of its map."""

    wheel: WheelMap
    vehicle: Vehicle | None

    @cached_property
    def constants(self) -> dict[str, Uncertain]:
        """Every constant that acts on the wheel, by name; see `constants_of`."""
        return constants_of(self.wheel, self.vehicle)

    @cached_property
    def values(self) -> dict[str, float]:
        """The constants without their standard deviations."""
        return {name: constant.value for name, constant in self.constants.items()}

    def of(
        self, channels: Mapping[str, Any], constants: Mapping[str, float] | None = None
    ) -> dict[str, Floats]:
        """Quantities (...) of channels (...); see `wheel_quantities`."""
        own = self.values if constants is None else constants
        found = wheel_quantities(channels, self.wheel, self.vehicle, own)
        return {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}


def constants_of(wheel: WheelMap, vehicle: Vehicle | None) -> dict[str, Uncertain]:
    """Every constant of the map that acts on a wheel, by name, with its standard deviation.

    The errors that all rows share are constants too: gains of 1 and offsets of 0.
    """
    found: dict[str, Uncertain] = {}
    if wheel.radius is not None:
        found["radius"] = wheel.radius
    for role, channel in wheel.channels.items():
        found[f"{role}.gain"] = Uncertain(1.0, channel.bias.share)
        found[f"{role}.offset"] = Uncertain(0.0, channel.bias.constant)
        if channel.value is not None:
            found[f"{role}.offset"] = Uncertain(0.0, channel.value.std)
        if role in GEARED:
            found[f"{role}.gear_ratio"] = channel.gear_ratio
        if role in ("torque", "motor_current"):
            found[f"{role}.efficiency"] = channel.efficiency
        if channel.torque_constant is not None:
            found[f"{role}.torque_constant"] = channel.torque_constant
            found[f"{role}.idle_current"] = channel.idle_current
    if wheel.leg is not None:
        found["wheel_leg.sensor_height"] = wheel.leg.sensor_height
    if vehicle is not None:
        for key in ("mass", "wheelbase", "behind_front", "height"):
            found[f"vehicle.{key}"] = getattr(vehicle, key)
    return found


def wheel_quantities(
    values: Mapping[str, Any],
    wheel: WheelMap,
    vehicle: Vehicle | None,
    constants: Mapping[str, float],
) -> dict[str, Any]:
    """Quantities (...) of a wheel from its channels (...), in SI units.

    values: Channels by role, as their sensors see them; `wheel_speed` and `ground_speed` are rates.
    constants: Values of `constants_of`.

    Returns: `rim_speed` and `speed` (m/s), `slip`, `torque`, `load`, `drawbar_pull`, `sinkage`, as
    far as the channels give them. In reverse, torque and drawbar pull are positive along the travel
    and the speed is below zero.
    """

    def read(role: str) -> Any:
        offset = constants.get(f"{role}.offset", 0.0)
        return constants.get(f"{role}.gain", 1.0) * values[role] + offset

    found: dict[str, Any] = {}
    if "rim_speed" in values:
        found["rim_speed"] = read("rim_speed")
    elif "wheel_speed" in values and "radius" in constants:
        source = "wheel_angle" if "wheel_angle" in wheel.channels else "wheel_speed"
        rate = read("wheel_speed") / constants.get(f"{source}.gear_ratio", 1.0)
        found["rim_speed"] = constants["radius"] * rate
    if "ground_speed" in values:
        found["speed"] = read("ground_speed")
    turning = found.get("rim_speed", values.get("wheel_speed", found.get("speed", 1.0)))
    direction = np.where(np.asarray(turning) < 0.0, -1.0, 1.0)
    if "slip" in values:
        found["slip"] = read("slip")
    elif {"rim_speed", "speed"} <= found.keys():
        found["slip"] = slip_ratio(direction * found["rim_speed"], direction * found["speed"])
    if "torque" in values:
        found["torque"] = direction * through_gearbox(
            read("torque"), direction, "torque", constants.__getitem__
        )
    elif "motor_current" in values:
        found["torque"] = direction * torque_from_current(
            read("motor_current"), direction, constants.__getitem__
        )
    if "load" in values:
        found["load"] = read("load")
    elif vehicle is not None:
        slope = read("slope") if "slope" in values else 0.0
        found["load"] = vehicle_load(vehicle, wheel.axle, slope, constants.__getitem__)
    if "drawbar_pull" in values:
        found["drawbar_pull"] = direction * read("drawbar_pull")
    if "sinkage" in values:
        found["sinkage"] = read("sinkage")
    elif "clearance" in values:
        # eq. 10 of Comin and Saaj 2017 with the leg vertical: at midstance
        hub = read("clearance") - constants["wheel_leg.sensor_height"]
        found["sinkage"] = constants["radius"] - hub
    if "vibration" in values:
        found["vibration"] = read("vibration")
    return found


def slip_ratio(rim: Any, ground: Any) -> Any:
    """Slip (...) of rim and travel speeds (...), m/s: 1 - v/(r omega), braking r omega/v - 1."""
    rim, ground = np.asarray(rim), np.asarray(ground)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rim >= ground, 1.0 - ground / rim, rim / ground - 1.0)


def torque_from_current(current: Any, turning: Any, constant: Constants) -> Any:
    r"""Torque (...) at the wheel from the current of its motor (...), A.

    .. math:: T = \eta G k_t (I - I_0)

    while the motor drives. While the wheel drives the motor, the losses of the gearbox come in
    addition: :math:`T = G k_t (I - I_0) / \eta`. `turning` is the sign of the rotation; the idle
    current I_0 opposes it.
    """
    motor = constant("motor_current.torque_constant") * (
        current - np.sign(turning) * constant("motor_current.idle_current")
    )
    return through_gearbox(motor, turning, "motor_current", constant)


def through_gearbox(motor: Any, turning: Any, role: str, constant: Constants) -> Any:
    """Torque (...) at the wheel of a torque at the motor (...), N m."""
    ratio, efficiency = constant(f"{role}.gear_ratio"), constant(f"{role}.efficiency")
    drives = np.asarray(motor) * np.sign(turning) >= 0.0
    return ratio * np.where(drives, efficiency, 1.0 / efficiency) * motor


def vehicle_load(vehicle: Vehicle, axle: str, slope: Any, constant: Constants) -> Any:
    r"""Load (...) of one wheel at slopes (...), rad, positive uphill, N.

    With two axles at a distance L, and the centre of mass d behind the front axle and h above the
    ground, the front axle carries

    .. math:: m g ((L - d) \cos\alpha - h \sin\alpha) / L

    and the rear axle the rest of :math:`m g \cos\alpha`, half on each side where there are four
    wheels. Without `wheelbase` or without axles, all wheels carry the same. Static: pull and
    acceleration shift no load.
    """
    normal = constant("vehicle.mass") * vehicle.gravity * np.cos(slope)
    length = constant("vehicle.wheelbase")
    if axle not in ("front", "rear") or not length > 0.0:
        return normal / vehicle.wheels
    weight = constant("vehicle.mass") * vehicle.gravity
    behind, height = constant("vehicle.behind_front"), constant("vehicle.height")
    front = weight * ((length - behind) * np.cos(slope) - height * np.sin(slope)) / length
    return (front if axle == "front" else normal - front) / max(1.0, vehicle.wheels / 2.0)


def slope_of(columns: Sequence[Floats]) -> Floats:
    """Slope (n,), rad, positive uphill, from one, three or four columns (n,) of an IMU.

    One is the angle itself. Three are accelerations forward, to the left and up, of a vehicle at
    rest or in steady motion, in any unit. Four are a quaternion x, y, z, w of any length, which
    turns axes forward, left and up (REP 103) into those of the world.
    """
    if len(columns) == 1:
        return columns[0]
    if len(columns) == 3:
        forward, left, up = columns
        return np.asarray(np.arctan2(forward, np.hypot(left, up)))
    x, y, z, w = columns
    with np.errstate(invalid="ignore", divide="ignore"):
        rise = 2.0 * (x * z - w * y) / (x**2 + y**2 + z**2 + w**2)
    return np.arcsin(np.clip(rise, -1.0, 1.0))
