"""Slip, torque, load and the other quantities of a wheel from its channels and the map;
errors that all rows share, from the uncertain constants of the map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import KNOWN_PARTS, Noise
from soilml.log_import.mapping.channel_map import GEARED, Uncertain
from soilml.log_import.mapping.log_map import Vehicle, WheelMap
from soilml.quantities import COLUMNS, column

#: Names of the offset and of the share that [bias] of a model file can state of a quantity.
_FORMS = {COLUMNS[key].name: parts for key, parts in KNOWN_PARTS.items()}


@dataclass(frozen=True)
class Conversion:
    """From channels of a wheel to its quantities, by the constants of its map."""

    wheel: WheelMap
    vehicle: Vehicle | None

    @cached_property
    def constants(self) -> dict[str, Uncertain]:
        """Every constant of the map that acts on the wheel, by name, with its standard deviation.

        The errors that all rows share are constants too: gains of 1 and offsets of 0.
        """
        found: dict[str, Uncertain] = {}
        if self.wheel.radius is not None:
            found["radius"] = self.wheel.radius
        for role, channel in self.wheel.channels.items():
            offset = channel.bias.constant if channel.value is None else channel.value.std
            found[f"{role}.gain"] = Uncertain(1.0, channel.bias.share)
            found[f"{role}.offset"] = Uncertain(0.0, offset)
            own = ["gear_ratio"] * (role in GEARED)
            own += ["efficiency"] * (role in ("torque", "motor_current"))
            own += ["torque_constant", "idle_current"] * (channel.torque_constant is not None)
            found |= {f"{role}.{key}": getattr(channel, key) for key in own}
        if self.wheel.leg is not None:
            found["wheel_leg.sensor_height"] = self.wheel.leg.sensor_height
        if self.vehicle is not None:
            for key in ("mass", "wheelbase", "behind_front", "height"):
                found[f"vehicle.{key}"] = getattr(self.vehicle, key)
        return found

    @cached_property
    def values(self) -> dict[str, float]:
        """The constants without their standard deviations."""
        return {name: constant.value for name, constant in self.constants.items()}

    def of(
        self, channels: Mapping[str, Any], constants: Mapping[str, float] | None = None
    ) -> dict[str, Floats]:
        """Quantities (...) of a wheel from its channels (...), in SI units.

        channels: By role, as their sensors see them; `wheel_speed` and `ground_speed` are rates.
        constants: By name, where they are not those of the map.

        Returns: `rim_speed` and `speed` (m/s), `slip`, `torque`, `load`, `drawbar_pull`, `sinkage`,
        as far as the channels give them. In reverse, torque and drawbar pull are positive along the
        travel and the speed is below zero.
        """
        own = self.values if constants is None else constants

        def read(role: str) -> Any:
            return own.get(f"{role}.gain", 1.0) * channels[role] + own.get(f"{role}.offset", 0.0)

        def at_wheel(role: str, motor: Any) -> Any:
            ratio, efficiency = own[f"{role}.gear_ratio"], own[f"{role}.efficiency"]
            return direction * through_gearbox(motor, direction, ratio, efficiency)

        found: dict[str, Any] = {}
        if "rim_speed" in channels:
            found["rim_speed"] = read("rim_speed")
        elif "wheel_speed" in channels and "radius" in own:
            source = "wheel_angle" if "wheel_angle" in self.wheel.channels else "wheel_speed"
            rate = read("wheel_speed") / own.get(f"{source}.gear_ratio", 1.0)
            found["rim_speed"] = own["radius"] * rate
        if "ground_speed" in channels:
            found["speed"] = read("ground_speed")
        turning = found.get("rim_speed", channels.get("wheel_speed", found.get("speed", 1.0)))
        direction = np.where(np.asarray(turning) < 0.0, -1.0, 1.0)
        if "slip" in channels:
            found["slip"] = read("slip")
        elif {"rim_speed", "speed"} <= found.keys():
            found["slip"] = slip_ratio(direction * found["rim_speed"], direction * found["speed"])
        if "torque" in channels:
            found["torque"] = at_wheel("torque", read("torque"))
        elif "motor_current" in channels:
            current = read("motor_current") - direction * own["motor_current.idle_current"]
            motor = own["motor_current.torque_constant"] * current
            found["torque"] = at_wheel("motor_current", motor)
        if "load" in channels:
            found["load"] = read("load")
        elif self.vehicle is not None:
            slope = read("slope") if "slope" in channels else 0.0
            found["load"] = vehicle_load(self.vehicle, self.wheel.axle, slope, own)
        if "drawbar_pull" in channels:
            found["drawbar_pull"] = direction * read("drawbar_pull")
        if "sinkage" in channels:
            found["sinkage"] = read("sinkage")
        elif "clearance" in channels:
            # eq. 10 of Comin and Saaj 2017 with the leg vertical: at midstance
            hub = read("clearance") - own["wheel_leg.sensor_height"]
            found["sinkage"] = own["radius"] - hub
        found |= {role: read(role) for role in ("vibration", "slope") if role in channels}
        return {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}

    def shared_errors(self, means: Mapping[str, Floats]) -> dict[str, Noise]:
        """The errors that rows share, by column.

        means: Channels of the rows (rows,).
        Each constant is changed by one standard deviation. The change of a quantity counts as
        relative or as an offset, whichever describes the rows better, and as [bias] can state it.
        Constants are taken as independent.
        """
        usual = self.of(means)
        bias: dict[str, Noise] = {}
        for name, constant in self.constants.items():
            if constant.std == 0.0:
                continue
            up, down = (
                self.of(means, self.values | {name: constant.value + sign * constant.std})
                for sign in (1.0, -1.0)
            )
            for key in (key for key in _FORMS if key in usual):
                change, reading = np.broadcast_arrays((up[key] - down[key]) / 2.0, usual[key])
                good = np.isfinite(change) & np.isfinite(reading)
                change, reading = np.atleast_1d(change[good]), np.atleast_1d(reading[good])
                if not np.any(change):
                    continue
                rms, size = (float(np.sqrt(np.mean(x**2))) for x in (change, reading))
                has_offset, has_share = _FORMS[key]
                gain = float(change @ reading) / (len(reading) * size**2) if size else 0.0
                by_share, by_offset = (
                    float(np.sum((change - part) ** 2)) for part in (gain * reading, change.mean())
                )
                as_share = by_share < by_offset
                if len(reading) == 1 and has_offset:
                    as_share = not name.endswith(("offset", "idle_current"))
                as_share = bool(has_share) and size > 0.0 and (as_share or not has_offset)
                one = Noise(share=rms / size) if as_share else Noise(constant=rms)
                bias[column(key)] = _joined(bias.get(column(key), Noise()), one, np.hypot)
        order = [column(key) for key in _FORMS if column(key) in bias]
        return {key: bias[key] for key in order}


def _joined(one: Noise, other: Noise, how: Any) -> Noise:
    return Noise(float(how(one.constant, other.constant)), float(how(one.share, other.share)))


def largest_errors(found: Sequence[Mapping[str, Noise]]) -> dict[str, Noise]:
    """Shared errors of several wheels as one table [bias], which their rows share: the largest."""
    bias: dict[str, Noise] = {}
    for own in found:
        for key, noise in own.items():
            bias[key] = _joined(bias.get(key, noise), noise, max)
    return bias


def slip_ratio(rim: Any, ground: Any) -> Any:
    """Slip (...) of rim and travel speeds (...), m/s: 1 - v/(r omega), braking r omega/v - 1."""
    rim, ground = np.asarray(rim), np.asarray(ground)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rim >= ground, 1.0 - ground / rim, rim / ground - 1.0)


def through_gearbox(motor: Any, turning: Any, ratio: float, efficiency: float) -> Any:
    r"""Torque (...) at the wheel of a torque at the motor (...), N m.

    .. math:: T = \eta G T_m

    while the motor drives; while the wheel drives the motor, the losses of the gearbox come in
    addition: :math:`T = G T_m / \eta`. `turning` is the sign of the rotation. From the current of
    a motor, :math:`T_m = k_t (I - I_0)`, where the idle current I_0 opposes the rotation.
    """
    drives = np.asarray(motor) * np.sign(turning) >= 0.0
    return ratio * np.where(drives, efficiency, 1.0 / efficiency) * motor


def vehicle_load(vehicle: Vehicle, axle: str, slope: Any, constant: Mapping[str, float]) -> Any:
    r"""Load (...) of one wheel at slopes (...), rad, positive uphill, N.

    With two axles at a distance L, and the centre of mass d behind the front axle and h above the
    ground, the front axle carries

    .. math:: m g ((L - d) \cos\alpha - h \sin\alpha) / L

    and the rear axle the rest of :math:`m g \cos\alpha`, half on each side where there are four
    wheels. Without `wheelbase` or without axles, all wheels carry the same. Static: pull and
    acceleration shift no load.
    """
    weight, length = constant["vehicle.mass"] * vehicle.gravity, constant["vehicle.wheelbase"]
    normal = weight * np.cos(slope)
    if axle not in ("front", "rear") or not length > 0.0:
        return normal / vehicle.wheels
    behind, height = constant["vehicle.behind_front"], constant["vehicle.height"]
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
