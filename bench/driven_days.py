"""Simulated days of a rover: soils that change and drift, glitches, stuck sensors, pauses.

The readings are those of the reference wheel of `datagen.blind_sets`, which shares no code with the
model that the files were trained on.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from drawn_errors import DrawnErrors

from datagen.blind_sets.plans import active_mechanisms
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Noise of the sensors: share of the torque, and standard deviation of slip.
TORQUE_NOISE, SLIP_STD = 0.02, 0.02
#: Rows on each soil, rows of a pause and of a stuck sensor, rows over which a drift goes on.
ROWS_PER_SOIL, ROWS_PAUSED, ROWS_STUCK, ROWS_DRIFTING = 100, 10, 20, 150
#: Rows of a slip sensor that is stuck, and the row of the second soil at which it begins.
ROWS_SLIP_STUCK, SLIP_STUCK_AT = 15, 60
#: Share of glitches, which are not among the first rows of a soil.
GLITCH_SHARE, FIRST_ROWS = 0.02, 12
#: Autocorrelation of slip and load from row to row.
PERSISTENCE = 0.8
#: Ends of slip, of load (N), and of the soils (Pa, rad, m), all inside of the prior.
SLIP, LOAD = (0.08, 0.55), (40.0, 110.0)
SOILS = np.asarray([[100.0, 2900.0], [0.45, 0.77], [0.006, 0.029]])
#: Falling friction angle (rad) and rising zero of the torque sensor (N m) at the end of a drift.
FRICTION_DRIFT, ZERO_DRIFT = -0.12, 0.5


class Kind(Enum):
    """What a row is in truth."""

    SOUND = "sound"
    GLITCH = "glitch"
    STUCK = "stuck"
    SLIP_STUCK = "slip stuck"
    PAUSED = "paused"
    DRIFTING = "drifting"


@dataclass(frozen=True)
class Day:
    """Rows of a drive, and the truth about them.

    Parameters
    ----------
    readings : dict
        Slip, load (N) and torque (N m), (n,).
    soils : ndarray
        Cohesion, friction angle and shear modulus, (n, 3).
    kinds : tuple of Kind
        What each row is.
    changes : tuple of (int, float)
        First row of each further soil, and the rms relative change of torque there.
    """

    readings: dict[str, Floats]
    soils: Floats
    kinds: tuple[Kind, ...]
    changes: tuple[tuple[int, float], ...]

    def row(self, i: int) -> dict[str, float]:
        """Readings of one row."""
        return {name: float(values[i]) for name, values in self.readings.items()}


def simulate_day(
    seed: int,
    drift: str = "friction",
    mechanism: str = "",
    size: float = 0.0,
    usual_errors: float = 0.0,
) -> Day:
    """A day on three soils with glitches, a stuck sensor and a pause, which ends with a drift.

    Parameters
    ----------
    seed : int
        Seeds everything that is drawn.
    drift : str
        ``friction``: the friction angle falls; ``zero``: the zero of the torque sensor rises.
    mechanism, size : str and float
        Key of an effect that the model of the files lacks, and its size; none by default.
    usual_errors : float
        Size, over the usual one, of random errors of the sensors on this day and of the model on
        each soil.
    """
    rng = np.random.default_rng(seed)
    count = 3 * ROWS_PER_SOIL + ROWS_PAUSED + ROWS_DRIFTING
    slip, load = (low + (high - low) * _wander(rng, count) for low, high in (SLIP, LOAD))
    of_row = np.minimum(np.arange(count) // ROWS_PER_SOIL, 2)
    three = SOILS[:, 0] + (SOILS[:, 1] - SOILS[:, 0]) * rng.random((3, 3))
    soils = three[of_row]
    begin = count - ROWS_DRIFTING
    ramp = np.clip((np.arange(count) - begin) / ROWS_DRIFTING, 0.0, 1.0)
    kinds = np.full(count, Kind.SOUND)
    kinds[begin:] = Kind.DRIFTING
    if drift == "friction":
        # from the upper half of the friction angles, so that it stays inside of the prior
        soils[of_row == 2, 1] = max(three[2, 1], SOILS[1, 0] - FRICTION_DRIFT)
        soils[:, 1] += FRICTION_DRIFT * ramp
    errors = DrawnErrors.drawn(3, seed, usual_errors)
    torque = wheel_torque(slip, load, soils, errors.of_rows(of_row), mechanism, size)
    changes = []
    for row in (ROWS_PER_SOIL, 2 * ROWS_PER_SOIL):
        here = slice(row, row + ROWS_PER_SOIL)
        before = np.broadcast_to(soils[row - 1], (ROWS_PER_SOIL, 3))
        of_before = errors.of_rows(np.full(ROWS_PER_SOIL, of_row[row - 1]))
        other = wheel_torque(slip[here], load[here], before, of_before, mechanism, size)
        ratio = torque[here] / other
        changes.append((row, float(np.sqrt(np.mean((ratio - 1.0) ** 2)))))
    sensors = errors.of_rows(of_row)
    torque = torque * (1.0 + sensors.torque_gain)
    slip, load = slip + sensors.slip_offset, load * (1.0 + sensors.load_gain)
    torque = torque * (1.0 + TORQUE_NOISE * rng.standard_normal(count))
    torque += ZERO_DRIFT * ramp * (drift == "zero")
    slip = np.clip(slip + SLIP_STD * rng.standard_normal(count), 0.01, 0.99)
    glitches = np.flatnonzero(rng.random(count) < GLITCH_SHARE)
    for number, row in enumerate(glitches[glitches % ROWS_PER_SOIL >= FIRST_ROWS]):
        if row < begin:
            kinds[row] = Kind.GLITCH
            _add_glitch(slip, torque, row, number)
    stuck = slice(2 * ROWS_PER_SOIL + 50, 2 * ROWS_PER_SOIL + 50 + ROWS_STUCK)
    torque[stuck] = torque[stuck.start - 1]
    kinds[stuck] = Kind.STUCK
    first = ROWS_PER_SOIL + SLIP_STUCK_AT
    slip[first : first + ROWS_SLIP_STUCK] = slip[first - 1]
    kinds[first : first + ROWS_SLIP_STUCK] = Kind.SLIP_STUCK
    paused = slice(begin - ROWS_PAUSED, begin)
    slip[paused], torque[paused], load[paused] = 0.0, 0.0, load[paused.start]
    kinds[paused] = Kind.PAUSED
    return Day({"slip": slip, "load": load, "torque": torque}, soils, tuple(kinds), tuple(changes))


def wheel_torque(
    slip: Floats,
    load: Floats,
    soils: Floats,
    errors: DrawnErrors,
    mechanism: str = "",
    size: float = 0.0,
) -> Floats:
    """Torque (n,) of the reference wheel on dry sand of other strength, without noise.

    `errors` of the rows are those of the model that is assumed.
    """
    wheel = {"radius": 0.15, "width": 0.12, "speed": 0.1, "pass_number": 1.0, "slip_angle": 0.0}
    sand = {"kc": 990.0, "kphi": 1528430.0, "n": 1.1, "a0": 0.4, "a1": 0.15, "unit_weight": 15e3}
    known = {name: np.full(len(slip), value) for name, value in (wheel | sand).items()}
    strength = dict(zip(("cohesion", "friction_angle", "shear_modulus"), soils.T, strict=True))
    bearing = errors.factor_of_bearing(slip, load)
    known |= {name: bearing * known[name] for name in ("kc", "kphi")}
    active = [(m, size) for m in active_mechanisms("A", mechanism)] if mechanism else []
    if errors.contact.any():
        active.append((errors.mechanism(slip), 1.0))
    state = WheelState(slip=slip, load=load, **known, **strength)
    return solve_equilibrium(state, tuple(active)).torque


def _add_glitch(slip: Floats, torque: Floats, row: int, number: int) -> None:
    """A doubled torque, no torque, or a slip that is off by a half, in turn."""
    if number % 3 == 2:
        slip[row] += 0.5 if slip[row] < 0.5 else -0.45
    else:
        torque[row] *= (2.0, 0.0)[number % 3]


def _wander(rng: np.random.Generator, count: int) -> Floats:
    """Values between 0 and 1 that follow each other slowly, (count,)."""
    steps = rng.standard_normal(count) * np.sqrt(1.0 - PERSISTENCE**2)
    values = np.empty(count)
    value = rng.standard_normal()
    for i, step in enumerate(steps):
        value = values[i] = PERSISTENCE * value + step
    return np.asarray(0.5 + np.arctan(1.6 * values) / np.pi)
