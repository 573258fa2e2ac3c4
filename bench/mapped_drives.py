"""Simulated drives over soil that changes from place to place, known to the simulator alone.

Forces are those of the reference wheel of `datagen.blind_sets`, which shares no code with soilml.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from drawn_errors import DrawnErrors
from driven_days import SOILS, wheel_torque
from scipy.special import ndtr
from slip_drives import WHEELS, loads

Floats = np.ndarray[Any, np.dtype[np.float64]]

STEP, LENGTH = 0.25, 60.0  # m between rows of a wheel, and of a drive
TURN, KEPT = 0.12, 0.9  # rad, turn of a step, and share that it has of the turn before
#: Noise: share of the torque, standard deviation of slip; share of glitches.
TORQUE_NOISE, SLIP_STD, GLITCHES = 0.02, 0.02, 0.01
SLIP, SLOPE = (0.08, 0.5), 0.2  # Ends of the slip; standard deviation of the slope, rad
#: Drift of the soil inside a patch: its share of the variance, and ends of its length, m.
DRIFT, LENGTHS = 0.4, (3.0, 12.0)
PATCHES = 3
WAVES = 200  # Of a smooth random field


@dataclass(frozen=True)
class MappedDrive:
    """Rows (n,) of all wheels, in the order of time, and the truth about them."""

    columns: dict[str, Any]  # As `soilml drive map` reads it
    soil: Floats  # Cohesion (Pa), friction angle (rad), shear modulus (m), (n, 3)
    patch: np.ndarray[Any, np.dtype[np.int64]]


def simulate_map_drive(
    seed: int, patches: int = PATCHES, drift: float = DRIFT, errors: float = 0.0
) -> MappedDrive:
    """A drive on a winding path over patches of soil that drift smoothly.

    patches: Soils that follow each other with sharp changes.
    drift: Share of the soil's variance that is a smooth field within a patch.
    errors: Size, over the usual one, of random errors: of sensors, and of the model on each patch.
    """
    rng = np.random.default_rng(seed)
    count, names = int(LENGTH / STEP), list(WHEELS)
    heading = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(TURN * _slow(rng, count))
    path = STEP * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    places = np.asarray([WHEELS[name] for name in names])
    along = np.column_stack([np.cos(heading), np.sin(heading)])[:, None]
    left = np.column_stack([-np.sin(heading), np.cos(heading)])[:, None]
    place = path[:, None] + places[:, :1] * along + places[:, 1:] * left
    station = STEP * np.arange(1, count + 1)[:, None] + places[:, 0]
    ends = np.sort(rng.uniform(0.15, 0.85, patches - 1)) * LENGTH
    patch = np.searchsorted(ends, station)
    base = rng.standard_normal((patches, 3))
    length = rng.uniform(*LENGTHS)
    score = np.sqrt(1.0 - drift) * base[patch]
    score = score + np.sqrt(drift) * _field(rng, place / length, patch, patches)
    soil = SOILS[:, 0] + (SOILS[:, 1] - SOILS[:, 0]) * ndtr(score)
    slip = SLIP[0] + (SLIP[1] - SLIP[0]) * ndtr(1.2 * _slow(rng, count))
    slip = np.clip(slip[:, None] + 0.03 * rng.standard_normal((count, len(names))), 0.05, 0.55)
    load = loads(SLOPE * np.clip(_slow(rng, count), -1.5, 1.5))
    rows = (slip.ravel(), load.ravel(), soil.reshape(-1, 3))
    drawn = DrawnErrors.drawn(patches, seed, errors)
    own = drawn.of_rows(patch.ravel())
    torque = wheel_torque(*rows, own) * (1.0 + own.torque_gain)
    torque *= 1.0 + TORQUE_NOISE * rng.standard_normal(torque.shape)
    glitch = rng.random(torque.shape) < GLITCHES
    torque = np.where(glitch, 2.0 * torque, torque)
    read = slip.ravel() + own.slip_offset + SLIP_STD * rng.standard_normal(torque.shape)
    columns = {
        "time_s": np.repeat(np.arange(count, dtype=float), len(names)),
        "wheel": np.tile(names, count),
        "x_m": np.repeat(path[:, 0], len(names)),
        "y_m": np.repeat(path[:, 1], len(names)),
        "heading_rad": np.repeat(heading, len(names)),
        "slip": np.clip(read, 0.01, 0.99),
        "torque_Nm": torque,
        "load_N": load.ravel() * (1.0 + own.load_gain),
    }
    return MappedDrive(columns, rows[2], patch.ravel())


def _slow(rng: np.random.Generator, count: int) -> Floats:
    """Normal values that follow each other slowly (n,)."""
    values = rng.standard_normal(count)
    for i in range(1, count):
        values[i] = KEPT * values[i - 1] + np.sqrt(1.0 - KEPT**2) * values[i]
    return values


def _field(rng: np.random.Generator, place: Floats, patch: Any, patches: int) -> Floats:
    """Smooth normal fields at places (n, k, 2), one of each patch and parameter, (n, k, 3)."""
    wave = rng.standard_normal((patches, 3, WAVES, 2))
    phase = rng.uniform(0.0, 2.0 * np.pi, (patches, 3, WAVES))
    found = np.empty((*patch.shape, 3))
    for i in range(patches):
        own = patch == i
        angle = np.einsum("nd,pwd->npw", place[own], wave[i]) + phase[i]
        found[own] = np.sqrt(2.0 / WAVES) * np.cos(angle).sum(axis=2)
    return found
