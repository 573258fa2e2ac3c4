"""The numbers that Xue et al. 2016 print, computed.

Their results are not included: the text states that the parameters are predicted accurately without
giving a number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError
from soilml.identification import identify
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.gears import LinearWheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import soil
from soilml.quantities import SHEAR

#: The wheel is assumed, the soil is from another paper, the load is printed.
NAME = "ding2015/lunar_soil"
WHEEL = LinearWheel(radius=0.15, width=0.15)
LOAD = 50.0
SLIPS = np.linspace(0.2, 0.6, 9)
COHESIONS = np.asarray([0.0, 170.0, 2700.0])[:, None]
#: Largest number of readings with which a method is tried, at distinct slips and loads.
MAX_READINGS = 4


@cache
def _angles() -> tuple[float, float]:
    """Angle of the maximum stress over the sum of entry and exit angle, and exit angle (rad)."""
    at = Operating(slip=SLIPS, load=LOAD)
    ground = soil(NAME, cohesion=COHESIONS, a0=0.5, a1=0.0)
    leave, peak = Model(WHEEL).profile(ground, at).angle
    entry = Model(WHEEL)(ground, at).entry_angle
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
    "load": lambda: LOAD,
    "theta_m": lambda: _angles()[0],
    "theta_2": lambda: _angles()[1],
    "determined": _identifiable_combinations,
    "linear_readings": lambda: _least_readings("linear", ("cohesion", "friction_angle")),
    "newton_readings": lambda: _least_readings("newton", ("friction_angle", "shear_modulus")),
}
