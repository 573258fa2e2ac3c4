"""Simulated stances of a wheel-leg on many soils: torque, sinkage and vibration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from soilml.physics.gears.wheel_leg_foot import Midstance
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil, soil
from soilml.systems.wheel_legs.stances import SpringLeg, vibration_amplitude

Floats = NDArray[np.float64]

#: The load testing foot of Comin and Saaj 2017, table III, all of it ahead of the leg.
FOOT = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
#: Load, N: a third of the printed 3.75 kg, which one foot does not carry on two of the four soils.
LOAD = 12.0
#: The commanded slips of the source's tests.
SLIPS = np.asarray([0.0, 0.125, 0.25, 0.375, 0.5])

#: Table I: name, K_A, sigma_0 (Pa) and alpha_z (Pa/m) of the four soils.
PRINTED = (
    ("ssc-1", 0.024, 0.84e4, 0.29e6),
    ("ssc-2", 0.017, 1.31e4, 1.05e6),
    ("ssc-3", 0.021, 0.29e4, 0.70e6),
    ("es-3", 0.022, 0.50e4, 1.70e6),
)


@dataclass(frozen=True)
class KnownSoil:
    """Soils as arrays (soils,), with their normal stiffness sigma_1 (Pa)."""

    soil: Soil
    normal_stiffness: Floats


@cache
def four_soils() -> KnownSoil:
    """The soils of table I under `FOOT`: K = K_A sqrt(A_s), A_s the sole; cohesion not below 0."""
    each = [
        soil(f"comin2017/{name}", shear_modulus=k * FOOT.area**0.5) for name, k, _, _ in PRINTED
    ]
    names = ("cohesion", "friction_angle", "shear_modulus", "kc", "kphi", "n")
    columns = {name: np.asarray([getattr(s, name) for s in each]) for name in names}
    stiffness = np.asarray([offset + 0.01 * gain for _, _, offset, gain in PRINTED])
    return KnownSoil(Soil(**columns), stiffness)


def sample_soils(count: int, seed: int) -> KnownSoil:
    """Random soils, each property uniform and independent within the range of table I."""
    draw = np.random.default_rng(seed).uniform

    def within(low: float, high: float) -> Floats:
        return np.asarray(draw(low, high, count))

    n, stiffness = within(0.45, 0.95), within(0.99e4, 2.36e4)
    return KnownSoil(
        Soil(
            cohesion=within(0.0, 1610.0), friction_angle=np.deg2rad(within(29.1, 42.8)),
            shear_modulus=within(0.017, 0.024) * FOOT.area**0.5, kc=np.zeros(count),
            kphi=stiffness / 0.01**n, n=n,
        ),
        stiffness,
    )  # fmt: skip


def midstance_torques(ground: KnownSoil, slip: Floats = SLIPS, load: float = LOAD) -> Floats:
    """Midstance torques (N m), (slips, soils); NaN where the soil does not carry the foot."""
    at = Operating(slip=np.asarray(slip)[:, None], load=load)
    return np.asarray(Model(FOOT)(ground.soil, at).torque)


@dataclass(frozen=True)
class StanceReadings:
    """One stance on each of many soils, arrays (soils,), with sensor noise."""

    ground: KnownSoil
    slip: Floats
    torque: Floats  # N m
    sinkage: Floats  # m
    vibration: Floats  # m/s^2


def simulate_stances(count: int, seed: int, noise: float = 0.03) -> StanceReadings:
    """Simulate one stance at a slip between 0.1 and 0.5 on each of `count` random soils.

    The friction angle drops by a fraction between 0.2 and 0.3, with a leg of 4 kN/m; the source
    prints neither. `noise` is the relative standard deviation of each reading; the slip has a
    standard deviation of 0.01.
    """
    rng = np.random.default_rng(seed + 1)
    ground = sample_soils(count, seed)
    slip = rng.uniform(0.1, 0.5, count)
    force = Model(FOOT)(ground.soil, Operating(slip=slip, load=LOAD))
    angle = np.asarray(ground.soil.friction_angle)
    drop = angle * rng.uniform(0.2, 0.3, count)
    vibration = vibration_amplitude(SpringLeg(stiffness=np.full(count, 4000.0)), slip, angle, drop)
    readings = np.stack([force.torque, force.sinkage, vibration])
    readings = readings * (1.0 + noise * rng.standard_normal(readings.shape))
    return StanceReadings(ground, slip + 0.01 * rng.standard_normal(count), *readings)
