"""The speed of a rover without odometry, without ROS: the content of messages in, twists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import asin, atan2, isfinite
from typing import Any

import numpy as np

from soil_estimator.rows import SECOND, RowCollector, Stretch
from soil_estimator.settings import as_number, check_time
from soilml.errors import InputError
from soilml.onboard.slip_stream import SlipStream

#: Parameters of the node, all but the last ones needed.
PARAMETERS = {
    "model": "path of a file of soilml export slip",
    "joints": "names of the wheels' joints in joint_states, in the order of the file's wheels",
    "wheel_radius": "radius of the wheels, m",
    "joint_signs": "1.0 or -1.0 for each joint: whether its velocity is positive forward",
    "frame": "frame of the twist, whose x points forward; base_link by default",
    "period": "time of the stamps that makes a row, s; 1.0 by default",
    "patience": "longest wait for late messages, s; 2.0 by default",
}
DEFAULTS = {"joint_signs": None, "frame": "base_link", "period": 1.0, "patience": 2.0}
LEAST_SPEED = 0.001  # m/s, below which a file's own limit decides
#: Variance of what the filter does not estimate: speed aside and up, rotations.
NOT_ESTIMATED = 1e6


@dataclass(frozen=True)
class Twist:
    """Forward speed at a stamp (ns), m/s, with its variance, and the flags of the row.

    `speed` is None where there is no answer.
    """

    stamp: int
    speed: float | None
    variance: float
    flags: tuple[str, ...]

    @property
    def covariance(self) -> np.ndarray:
        """Of linear and angular velocity, 6 x 6 by rows, (36,)."""
        return np.diag([self.variance, *[NOT_ESTIMATED] * 5]).ravel()


@dataclass
class RoverCollector(RowCollector):
    """Rows of all wheels and the attitude: means over a stretch of stamps."""

    def row(self, end: int, values: Mapping[str, list[float]]) -> Stretch:
        """The means, whatever the wheels do: the filter says which rows it passes over."""
        mean = {name: sum(part) / len(part) for name, part in values.items()}
        if not isfinite(sum(mean.values())):
            return Stretch(end, None, "samples are too large")
        return Stretch(end, mean)


@dataclass
class SlipLogic:
    """Speed of a rover from joint states and an inertial unit.

    Raises `InputError` for a parameter that is missing or wrong, with one line that names it.
    """

    given: Mapping[str, object]
    stream: SlipStream = field(init=False)

    def __post_init__(self) -> None:
        values = DEFAULTS | {n: v for n, v in self.given.items() if v is not None}
        for name, text in PARAMETERS.items():
            if name not in values:
                raise InputError(f"the parameter {name} is missing: {text}")
        for name in ("model", "frame"):
            if not isinstance(values[name], str):
                raise InputError(f"the parameter {name} is {values[name]!r}; needed is a text")
        self.stream, self.frame = SlipStream.load(str(values["model"])), str(values["frame"])
        wheels = len(self.stream.wheels)
        self._joints = _list("joints", values["joints"])
        signs = [1.0] * wheels
        if values["joint_signs"] is not None:
            signs = _list("joint_signs", values["joint_signs"])
        if len(self._joints) != wheels or len(signs) != wheels:
            raise InputError(
                f"the parameter joints names {len(self._joints)}; {values['model']} has {wheels} "
                f"wheels: {', '.join(self.stream.wheels)}"
            )
        if len({str(joint) for joint in self._joints}) < wheels:
            raise InputError("the parameter joints names a joint twice")
        self._signs = [as_number("joint_signs", sign, PARAMETERS) for sign in signs]
        if {abs(sign) for sign in self._signs} != {1.0}:
            raise InputError("the parameter joint_signs has other numbers than 1.0 and -1.0")
        times = {n: as_number(n, values[n], PARAMETERS) for n in ("period", "patience")}
        for name, seconds in times.items():
            check_time(name, seconds)
        self._radius = as_number("wheel_radius", values["wheel_radius"], PARAMETERS)
        if self._radius <= 0.0:
            raise InputError(
                f"the parameter wheel_radius is {self._radius:g}; it must be above zero"
            )
        if not np.allclose(self.stream.radius, self._radius, rtol=1e-3):
            raise InputError(
                f"the parameter wheel_radius is {self._radius:g}; {values['model']} is for wheels "
                f"of {', '.join(f'{radius:g}' for radius in self.stream.radius)} m"
            )
        sources = {"pitch": "the inertial unit", "roll": "the inertial unit"}
        for i, joint in enumerate(self._joints):
            sources |= {f"speed_{i}": f"velocity of {joint}", f"torque_{i}": f"effort of {joint}"}
        self._rows = RoverCollector(
            self._radius, 0.0, times["period"], times["patience"], LEAST_SPEED, sources=sources
        )
        self.restart()

    def restart(self) -> None:
        """Forget all rows: the ground is known to be another one."""
        self._state = self.stream.start()
        self._last: int | None = None
        self._rows.forget()

    def on_joints(
        self, stamp: int, names: Sequence[str], velocity: Sequence[float], effort: Sequence[float]
    ) -> list[Twist]:
        """Take a sensor_msgs/JointState: stamp in ns, rad/s, N m; joints are found by name."""
        samples = {}
        for i, (joint, sign) in enumerate(zip(self._joints, self._signs, strict=True)):
            if joint in names:
                at = list(names).index(joint)
                if at < len(velocity):
                    samples[f"speed_{i}"] = sign * self._radius * float(velocity[at])
                if at < len(effort):
                    samples[f"torque_{i}"] = sign * float(effort[at])
        return self._add(stamp, samples)

    def on_attitude(self, stamp: int, x: float, y: float, z: float, w: float) -> list[Twist]:
        """Take the orientation of a sensor_msgs/Imu (x forward, y left, z up), a unit quaternion.

        Pitch here is positive uphill, against the sense of rotation about y (REP 103).
        """
        norm = x * x + y * y + z * z + w * w
        if not 0.5 < norm < 2.0:  # not a rotation: the message has no orientation
            return []
        down = 2.0 * (w * y - z * x) / norm
        roll = atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z)
        return self._add(stamp, {"pitch": -asin(min(max(down, -1.0), 1.0)), "roll": roll})

    def _add(self, stamp: int, samples: Mapping[str, float]) -> list[Twist]:
        if stamp <= 0:
            return []
        found = [self._twist(stretch) for stretch in self._rows.add(stamp, samples)]
        return [twist for twist in found if twist is not None]

    def _twist(self, stretch: Stretch) -> Twist | None:
        if stretch.row is None:
            return None
        row, wheels = stretch.row, range(len(self._joints))
        elapsed = 1.0 if self._last is None else max((stretch.end - self._last) / SECOND, 1e-3)
        self._last = stretch.end
        load = self.stream.loads(row["pitch"], row["roll"])
        if load.min() <= 0.0:
            return Twist(stretch.end, None, NOT_ESTIMATED, ("wheel-off-the-ground",))
        try:
            answer, self._state = self.stream.step(
                self._state,
                [row[f"speed_{i}"] for i in wheels],
                [row[f"torque_{i}"] for i in wheels],
                load,
                row["pitch"],
                elapsed,
            )
        except InputError:  # a row that is not possible: the state stays as it was
            return Twist(stretch.end, None, NOT_ESTIMATED, ("row-not-possible",))
        speed = answer.speed if answer.answered else None
        return Twist(stretch.end, speed, answer.speed_std**2, answer.flags)


def _list(name: str, values: Any) -> list[Any]:
    """The elements of a parameter; a text is not the list of its letters."""
    if isinstance(values, str) or not hasattr(values, "__len__"):
        raise InputError(
            f"the parameter {name} is {values!r}; needed is a list, one for each wheel"
        )
    return list(values)
