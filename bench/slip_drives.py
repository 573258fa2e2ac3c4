"""Simulated drives of a rover over soils and slopes, whose slip is known to the simulator alone.

Forces are those of the reference wheel of `datagen.blind_sets`, which shares no code with soilml.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from datagen.blind_sets.plans import active_mechanisms
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium

Floats = np.ndarray[Any, np.dtype[np.float64]]

MASS, GRAVITY, HEIGHT = 30.0, 9.80665, 0.3  # kg, m/s^2, m of the centre of mass
RADIUS, WIDTH = 0.15, 0.12  # m, of each wheel
WHEELS = {
    "front-left": (0.4, 0.3),
    "front-right": (0.4, -0.3),
    "rear-left": (-0.4, 0.3),
    "rear-right": (-0.4, -0.3),
}
SPEED = 0.1  # m/s, commanded speed of the rims
#: Ranges of the soils, SI: those of the prior in `examples/slip/rover.toml`.
SOILS = {
    "cohesion": (0.0, 3000.0),
    "friction_angle": (0.436332, 0.785398),
    "shear_modulus": (0.005, 0.03),
    "kphi": (5e5, 5e6),
    "n": (0.7, 1.3),
}
FIXED = {"kc": 990.0, "a0": 0.4, "a1": 0.15, "unit_weight": 15e3}
#: What is drawn for each drive: friction of each wheel's drive (N m), its gain, the pitch's zero
#: (rad); and for each row: standard deviations of pitch (rad), torque and rim speed (shares).
LOSS, LOSS_STD, GAIN, TILT = 0.3, 0.15, 0.05, 0.01
ROW_TILT, TORQUE_NOISE, SPEED_NOISE = 0.005, 0.02, 0.005
STEEPEST = 0.35  # rad, largest pitch
SLIPS = np.concatenate([-np.geomspace(0.6, 0.01, 12), [0.0], np.geomspace(0.01, 0.92, 26)])


@dataclass(frozen=True)
class Drive:
    """Rows of a drive (n,), of k wheels, and the truth about them."""

    time: Floats  # s
    rim_speed: Floats  # As read, m/s (n, k)
    torque: Floats  # As read, N m (n, k)
    slope: Floats  # As read, rad (n,)
    slip: Floats  # True slip (n, k)
    speed: Floats  # True body speed, m/s (n,)
    ground: np.ndarray[Any, Any]  # Number of the ground of each row (n,); -1 a hard floor
    soils: tuple[dict[str, float], ...]

    def columns(self) -> dict[str, Any]:
        """A table with a row for each time and wheel, as `soilml drive slip` reads it."""
        count, wheels = self.torque.shape
        return {
            "time_s": np.repeat(self.time, wheels),
            "wheel": np.tile(list(WHEELS), count),
            "rim_speed_m_s": self.rim_speed.flatten(),
            "torque_Nm": self.torque.flatten(),
            "slope_rad": np.repeat(self.slope, wheels),
        }


def loads(slope: Floats) -> Floats:
    """Loads of the four wheels, N (n, 4): moments about the contacts of two axles."""
    half = WHEELS["front-left"][0]
    axle = 0.25 * MASS * GRAVITY * (np.cos(slope) - HEIGHT / half * np.sin(slope))
    rear = 0.25 * MASS * GRAVITY * (np.cos(slope) + HEIGHT / half * np.sin(slope))
    return np.stack([axle, axle, rear, rear], axis=-1)


def simulate_drive(
    seed: int,
    soils: int = 3,
    rows: int = 60,
    apart: float = 0.0,
    mechanism: str = "",
    size: float = 0.0,
    floor: bool = False,
) -> Drive:
    """A drive over soils and slopes; `apart` is how far rim speeds differ (share, standard dev.).

    mechanism, size: Key of a mechanism that the model lacks, and its size.
    floor: Whether the rover drives on a hard floor instead.
    """
    rng = np.random.default_rng(seed)
    count = rows * (1 if floor else soils)
    rim = SPEED * (1.0 + apart * _slow(rng, (count, len(WHEELS))))
    wish = STEEPEST * (0.3 + 0.5 * _slow(rng, (count,)))
    tilt = TILT * rng.standard_normal()
    grounds = [] if floor else [_soil(rng) for _ in range(soils)]
    slope, speed = np.empty(count), np.empty(count)
    torque, slip = np.empty((count, 4)), np.empty((count, 4))
    ground = np.full(count, -1) if floor else np.arange(count) // rows
    for number in np.unique(ground):
        own = ground == number
        forces = _Floor(rng) if floor else _Soil(grounds[number], mechanism, size)
        slope[own], speed[own] = _balanced(forces, rim[own], np.clip(wish[own], -0.2, STEEPEST))
        slip[own] = _slip(speed[own][:, None] / rim[own])
        torque[own] = forces.torque(slip[own], loads(slope[own]))
    loss = np.maximum(LOSS + LOSS_STD * rng.standard_normal(4), 0.0)
    gain = 1.0 + GAIN * rng.standard_normal(4)
    read = gain * torque * (1.0 + TORQUE_NOISE * rng.standard_normal(torque.shape)) + loss
    return Drive(
        np.arange(count, dtype=float),
        rim * (1.0 + SPEED_NOISE * rng.standard_normal(rim.shape)),
        read,
        slope + tilt + ROW_TILT * rng.standard_normal(count),
        slip,
        speed,
        ground,
        tuple(grounds),
    )


def _soil(rng: np.random.Generator) -> dict[str, float]:
    """A soil that carries the rover on level ground."""
    while True:
        soil = {name: float(rng.uniform(*ends)) for name, ends in SOILS.items()}
        soil["kphi"] = float(np.exp(rng.uniform(*np.log(SOILS["kphi"]))))
        pull = _Soil(soil | FIXED).pull(np.full((1, 4), 0.6), loads(np.zeros(1))).sum()
        if pull > 0.1 * MASS * GRAVITY:
            return soil | FIXED


class _Soil:
    """Forces on a soil: pull by a spline over slip and load, torque solved."""

    def __init__(self, soil: dict[str, float], mechanism: str = "", size: float = 0.0) -> None:
        names = [(m, size) for m in active_mechanisms("A", mechanism)] if mechanism else []
        self.soil, self.active = soil, tuple(names)
        ends = loads(np.asarray([-0.25, STEEPEST + 0.05]))
        load = np.geomspace(ends.min(), ends.max(), 8)
        grid = np.meshgrid(SLIPS, load, indexing="ij")
        pull = self._solve(*(g.ravel() for g in grid)).pull.reshape(grid[0].shape)
        self.spline = RectBivariateSpline(SLIPS, load, pull, kx=3, ky=3)

    def _solve(self, slip: Floats, load: Floats) -> Any:
        return solve_equilibrium(
            WheelState.on_soil(self.soil, slip, load, RADIUS, WIDTH), self.active
        )

    def pull(self, slip: Floats, load: Floats) -> Floats:
        return np.asarray(self.spline.ev(slip, load))

    def torque(self, slip: Floats, load: Floats) -> Floats:
        return np.asarray(self._solve(slip.ravel(), load.ravel()).torque.reshape(slip.shape))


class _Floor:
    """Forces on a hard floor: friction that rises with slip, and rolling resistance."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.friction, self.stiff = rng.uniform(0.5, 0.8), rng.uniform(0.012, 0.03)
        self.rolling = rng.uniform(0.005, 0.03)

    def pull(self, slip: Floats, load: Floats) -> Floats:
        return self.torque(slip, load) / RADIUS - self.rolling * load

    def torque(self, slip: Floats, load: Floats) -> Floats:
        return np.asarray(RADIUS * load * self.friction * np.tanh(slip / self.stiff))


def _balanced(forces: Any, rim: Floats, wish: Floats) -> tuple[Floats, Floats]:
    """Slope (n,), as wished where the rover holds it, and the body speed there, m/s."""
    share = _RATIOS[:, None] * rim.max(axis=1)
    slip = np.clip(_slip(share[..., None] / rim), SLIPS[0], SLIPS[-1])
    slope = wish.copy()
    for _ in range(4):
        pull = forces.pull(slip, np.broadcast_to(loads(slope), slip.shape)).sum(axis=-1)
        most = np.arcsin(0.93 * pull.max(axis=0) / (MASS * GRAVITY))
        slope = np.minimum(slope, most)
    pull = forces.pull(slip, np.broadcast_to(loads(slope), slip.shape)).sum(axis=-1)
    needed = MASS * GRAVITY * np.sin(slope)
    after = np.clip(np.argmax(pull >= needed, axis=0), 1, None)
    rows = np.arange(len(slope))
    low, high = pull[after - 1, rows], pull[after, rows]
    part = np.clip((needed - low) / (high - low), 0.0, 1.0)
    return slope, share[after - 1, rows] + part * (share[after, rows] - share[after - 1, rows])


#: Ratios of travel to rolling of the fastest wheel, falling as its slip rises.
_RATIOS = 1.0 - np.concatenate([-np.geomspace(0.6, 0.004, 150), np.geomspace(0.001, 0.9, 400)])


def _slip(ratio: Floats) -> Floats:
    return np.where(ratio > 1.0, 1.0 / np.maximum(ratio, 1.0) - 1.0, 1.0 - ratio)


def _slow(rng: np.random.Generator, shape: tuple[int, ...], kept: float = 0.9) -> Floats:
    """Normal values that follow each other slowly along the first axis."""
    steps = rng.standard_normal(shape) * np.sqrt(1.0 - kept**2)
    steps[0] = rng.standard_normal(shape[1:])
    for i in range(1, len(steps)):
        steps[i] += kept * steps[i - 1]
    return steps
