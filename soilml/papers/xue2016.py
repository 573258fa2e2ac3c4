"""The numbers that Xue et al. 2016 print, computed.

Their results are not included: the text states that the parameters are predicted accurately without
giving a number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError
from soilml.identification import identify
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.contact import Force
from soilml.physics.gears import LinearWheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil, soil
from soilml.quantities import SHEAR

#: The wheel is assumed, the soil is from another paper, the load is printed.
NAME = "ding2015/lunar_soil"
WHEEL = LinearWheel(radius=0.15, width=0.15)
LOAD = 50.0
#: Cohesions beyond the lunar range as well: the equations must agree for all of them.
SLIPS = np.linspace(0.2, 0.6, 9)
COHESIONS = np.asarray([0.0, 170.0, 2700.0])[:, None]
#: Largest number of readings with which a method is tried, at distinct slips and loads.
MAX_READINGS = 4


def _soil() -> Soil:
    """Lunar soil of the catalogue with the maximum stress midway, as in the paper."""
    return soil(NAME, cohesion=COHESIONS, a0=0.5, a1=0.0)


@dataclass(frozen=True)
class _Integrals:
    """Load (N), drawbar pull (N) and torque (N m) by quadrature of the linear stresses."""

    load: Floats
    pull: Floats
    torque: Floats


@cache
def _simulated() -> Force:
    return Model(WHEEL)(_soil(), Operating(slip=SLIPS, load=LOAD))


@cache
def _quadrature() -> _Integrals:
    r"""Eqs. 2-4 of the stresses of eqs. 1 and 5-8, piece by piece, at the model's own sinkage.

    .. math:: \tau_{offset} = \tau(0), \qquad \tau_m = \tau(\theta_m)

    with the Gauss-Legendre rule of 40 points: exact to rounding for these integrands.
    """
    ground, r, area = _soil(), WHEEL.radius, WHEEL.radius * WHEEL.width
    entry = np.asarray(_simulated().entry_angle)
    peak = 0.5 * entry  # theta_2 = 0
    depth = r * (np.cos(peak) - np.cos(entry))
    normal = (ground.kc / WHEEL.width + ground.kphi) * depth**ground.n
    offset, largest = _shear(0.0, 0.0, entry), _shear(normal, peak, entry)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    load, pull, torque = (np.zeros_like(entry) for _ in range(3))
    for x, weight in zip(0.5 * (nodes + 1.0), 0.5 * weights, strict=True):
        front = (entry - peak) * weight, peak + x * (entry - peak), (1 - x) * normal
        rear = peak * weight, x * peak, x * normal
        shears = (1 - x) * largest, offset + (largest - offset) * x
        for (step, angle, sigma), tau in zip((front, rear), shears, strict=True):
            load += area * step * (sigma * np.cos(angle) + tau * np.sin(angle))
            pull += area * step * (tau * np.cos(angle) - sigma * np.sin(angle))
            torque += r * area * step * tau
    return _Integrals(load, pull, torque)


def _shear(normal: Floats | float, angle: Floats | float, entry: Floats) -> Floats:
    """Shear stress of eq. 1 where the normal stress is known, Pa."""
    ground = _soil()
    travel = entry - angle - (1.0 - SLIPS) * (np.sin(entry) - np.sin(angle))
    strength = ground.cohesion + normal * np.tan(ground.friction_angle)
    return np.asarray(
        strength * -np.expm1(-WHEEL.radius * travel / np.asarray(ground.shear_modulus))
    )


def _relative_difference(values: Floats, expected: Floats, scale: Floats) -> float:
    return float(np.max(np.abs(values - expected) / np.abs(scale)))


@cache
def _angles() -> tuple[float, float]:
    """Angle of the maximum stress over the sum of entry and exit angle, and exit angle (rad)."""
    at = Operating(slip=SLIPS, load=LOAD)
    leave, peak = Model(WHEEL).profile(_soil(), at).angle
    entry = _simulated().entry_angle
    return float(np.max(peak / (entry + leave))), float(np.max(np.abs(leave)))


def _identifiable_combinations() -> float:
    """Number of combinations of (c, phi, K) determined by one torque: rank of its derivatives."""
    ground, at = soil(NAME, a0=0.5, a1=0.0), Operating(slip=0.4, load=LOAD)
    factors = np.asarray([0.999, 1.001])
    moved = (replace(ground, **{name: getattr(ground, name) * factors}) for name in SHEAR)
    slopes = [np.diff(Model(WHEEL)(one, at).torque) for one in moved]
    return float(np.linalg.matrix_rank(np.asarray(slopes)))


def _least_readings(method: str, free: tuple[str, ...]) -> float:
    """Fewest readings of torque and sinkage from which a method identifies its unknowns."""
    priors = {
        "cohesion": Prior(0.0, 5000.0),
        "friction_angle": Prior(0.3, 1.0),
        "shear_modulus": Prior(0.002, 0.05),
        "kphi": Prior(1e5, 5e6, log=True),
    }
    noise = {"torque_Nm": Noise(share=0.001), "sinkage_m": Noise(constant=1e-6)}
    case = Case(Model(WHEEL), soil(NAME, a0=0.5, a1=0.0), priors, noise)
    slip = np.linspace(0.2, 0.6, MAX_READINGS)
    load = np.linspace(30.0, 70.0, MAX_READINGS)
    force = case.model(case.soil, Operating(slip=slip, load=load))
    for count in range(1, MAX_READINGS + 1):
        columns = {"slip": slip, "load_N": load, "torque_Nm": force.torque}
        if method == "linear":
            columns["sinkage_m"] = force.sinkage
        try:
            identify(case, Table({k: v[:count] for k, v in columns.items()}), free, method)
        except FitError:
            continue
        return float(count)
    return float("nan")


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    "load": lambda: float(_quadrature().load[1, 0]),
    "theta_m": lambda: _angles()[0],
    "theta_2": lambda: _angles()[1],
    "load_consistent": lambda: _relative_difference(
        _simulated().load, _quadrature().load, np.full_like(_quadrature().load, LOAD)
    ),
    "pull_consistent": lambda: _relative_difference(
        _simulated().drawbar_pull, _quadrature().pull, np.full_like(_quadrature().load, LOAD)
    ),
    "torque_consistent": lambda: _relative_difference(
        _simulated().torque, _quadrature().torque, _quadrature().torque
    ),
    "determined": _identifiable_combinations,
    "linear_readings": lambda: _least_readings("linear", ("cohesion", "friction_angle")),
    "newton_readings": lambda: _least_readings("newton", ("friction_angle", "shear_modulus")),
}
