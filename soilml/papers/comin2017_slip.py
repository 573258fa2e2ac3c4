"""The numbers that Comin and Saaj 2017 print on slip, soil, fusion and mobility, computed.

Torque-slip: `FOOT` in midstance under `LOAD` on the four soils at the five commanded slips.
Vibration-slip: legs of 3 to 6 kN/m on a soil of 40 degrees whose friction drops by 4 to 20 degrees
when it slips, at the four slips above zero. Pull efficiency: a wheel 0.18 m wide at a slip of 0.2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.onboard.fusion_rules import inverse_variance, pairwise
from soilml.papers.published import printed
from soilml.physics.gears import Midstance
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import pull_efficiency
from soilml.physics.soils import Soil, soil
from soilml.systems.wheel_legs.resistive_force import GROUNDS
from soilml.systems.wheel_legs.stances import SpringLeg, vibration_amplitude
from soilml.systems.wheel_legs.stride_relations import (
    GRAVITY,
    PRESSURE,
    SINKAGE_ERRORS,
    STIFFNESS,
    TORQUE_ERRORS,
    TORQUE_SLIP,
    VIBRATION_ERRORS,
    VIBRATION_SLIP,
)
from soilml.systems.wheel_legs.strides import HEAVY_AT, HEAVY_WHEEL

WHEEL = Model(HEAVY_WHEEL)
#: The Load Testing Foot of table III, all of it ahead of the leg: an arc of radius 14.8 cm that
#: leaves the leg level. In walks (`geometry.FEET`) its radius is 3.9 cm.
FOOT = Midstance.of_foot(length=0.04, height=0.0055, width=0.029, leg_length=0.18)
#: Load, N: a third of the printed 3.75 kg, which one foot does not carry on two of the four soils.
LOAD = 12.0
SLIPS = np.asarray([0.0, 0.125, 0.25, 0.375, 0.5])  # The commanded slips of the source's tests
#: Springs to which the vibration-slip models are fitted: N/m, rad, and the friction angle.
STIFFNESSES = np.linspace(3000.0, 6000.0, 7)
DROPS = np.deg2rad(np.linspace(4.0, 20.0, 9))
FRICTION = math.radians(40.0)
#: Standard deviations (%) of the errors of torque, vibration and sinkage, table VIII, all soils.
STD = {
    name: tuple(one.scatter[k] for one in (TORQUE_ERRORS, VIBRATION_ERRORS, SINKAGE_ERRORS))
    for k, name in enumerate(("friction", "stiffness"))
}
K_A = {"ssc-1": 0.024, "ssc-2": 0.017, "ssc-3": 0.021, "es-3": 0.022}  # Table I
SIGMA = np.asarray([ground.normal_stiffness for ground in GROUNDS.values()])  # Pa


@cache
def four_soils() -> Soil:
    """The soils of table I under `FOOT`: K = K_A sqrt(A_s), A_s the sole; cohesion not below 0."""
    each = [soil(f"comin2017/{n}", shear_modulus=k * FOOT.area**0.5) for n, k in K_A.items()]
    names = ("cohesion", "friction_angle", "shear_modulus", "kc", "kphi", "n")
    return Soil(**{name: np.asarray([getattr(s, name) for s in each]) for name in names})


def fit_lines(reading: Floats, slip: Floats) -> tuple[Floats, Floats, Floats]:
    """Regress slip (slips,) on a reading (slips, soils): intercepts, slopes and R^2, (soils,)."""
    slips = np.broadcast_to(np.asarray(slip, float)[:, None], reading.shape)
    x, y = reading - reading.mean(axis=0), slips - slips.mean(axis=0)
    with np.errstate(invalid="ignore"):  # a reading that is equal at all slips has no slope: NaN
        slope = (x * y).sum(axis=0) / (x * x).sum(axis=0)
    if np.isnan(slope).any():
        raise FitError(f"{int(np.isnan(slope).sum())} of {slope.size} soils have no slip model")
    left = ((y - slope * x) ** 2).sum(axis=0) / (y * y).sum(axis=0)
    return slips.mean(axis=0) - slope * reading.mean(axis=0), slope, 1.0 - left


def _plane(y: Floats, *terms: Floats) -> tuple[Floats, float]:
    """Coefficients of y = c + p first + q second, and R^2."""
    columns = np.column_stack([np.ones_like(y), *terms])
    coefficients, *_ = np.linalg.lstsq(columns, y, rcond=None)
    residual = y - columns @ coefficients
    return np.asarray(coefficients, dtype=np.float64), 1.0 - float(
        residual @ residual / np.sum((y - y.mean()) ** 2)
    )


Fit = dict[str, tuple[Floats, float]]  # Coefficients and R^2 of each part


@cache
def torque_fit() -> Fit:
    """The terramechanics form of table IV, eqs. 18 and 27, on the four soils: (c, b, a), (c, b)."""
    known = four_soils()
    at = Operating(slip=SLIPS[:, None], load=LOAD)
    a, b, _ = fit_lines(np.asarray(Model(FOOT)(known, at).torque), SLIPS)
    friction = _plane(np.asarray(known.friction_angle), b, a)
    return {"friction": friction, "stiffness": _plane(SIGMA / PRESSURE, b)}


@cache
def vibration_fit(planar: bool) -> Fit:
    """Table V, eqs. 24 and 25, fitted to the rotating spring: (c_I, c_mu, c_K), (a_mu, b_mu)."""
    stiffness, drop = (v.ravel() for v in np.meshgrid(STIFFNESSES, DROPS))
    vibration = vibration_amplitude(SpringLeg(stiffness=stiffness), SLIPS[1:, None], FRICTION, drop)
    a, b, _ = fit_lines(vibration, SLIPS[1:])
    springs = (stiffness / STIFFNESS,) if planar else ()
    return {
        "intercept": _plane(a, np.rad2deg(drop), *springs),
        "slope": _plane(b * GRAVITY, np.rad2deg(drop)),
    }


@cache
def efficiency(name: str) -> float:
    """Pull efficiency (%) of a wheel of the 300 kg rover, one of six, on a soil of table I."""
    return 100.0 * float(pull_efficiency(WHEEL, soil(f"comin2017/{name}"), HEAVY_AT))


def constant_intercept() -> float:
    """Mean intercept of the empirical model (table IV) over the four soils of table I."""
    a, _ = TORQUE_SLIP["empirical"].line(np.asarray(four_soils().friction_angle), SIGMA)
    return float(a.mean())


def _coefficient(fit: Callable[[], Fit], part: str, index: int | None = None) -> float:
    """A coefficient of a fit, or R^2."""
    coefficients, r2 = fit()[part]
    return r2 if index is None else float(coefficients[index])


PRINTED = printed("comin2017_slip")
#: Models of table VIII of which table IX fuses the estimates, in the order of its weights.
FUSED = ("ts", "vl", "s")


def fused_error(ground: str, part: str, name: str) -> float:
    """Mean error (%) of a property on a soil: the weights of table IX on errors of table VIII."""
    weights = (PRINTED[f"t9_{sense}_{name}_weight"] for sense in "tvs")
    errors = (PRINTED[f"t8_{model}_{ground}_{part}_mean"] for model in FUSED)
    return sum(w * e for w, e in zip(weights, errors, strict=True))


@cache
def characterised_efficiency(name: str) -> float:
    """Pull efficiency (%) on a soil of table I with the fused mean errors of its properties."""
    known = soil(f"comin2017/{name}")
    angle = 1.0 + fused_error(name, "phi", "friction") / 100.0
    stiffness = 1.0 + fused_error(name, "sigma", "stiffness") / 100.0
    found = replace(known, friction_angle=known.friction_angle * angle, kphi=known.kphi * stiffness)
    return 100.0 * float(pull_efficiency(WHEEL, found, HEAVY_AT))


def _mean_by_others(torque: str) -> float:
    """Change of the mean error of vibration, linear, from the printed ones of other pairs.

    The change of torque less that of vibration is the difference of their own mean errors, which
    the empirical model shows for both models of vibration.
    """

    def apart(pair: str) -> float:
        return PRINTED[f"t6_{pair}_mean_t"] - PRINTED[f"t6_{pair}_mean_v"]

    between = apart("el") - apart("ep")
    return PRINTED[f"t6_{torque}l_mean_t"] - (apart(f"{torque}p") + between)


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    **{
        f"t4_tt_{letter}_{what}": partial(_coefficient, torque_fit, part, k)
        for what, part, letters in (("tau", "friction", "cba"), ("sigma", "stiffness", "cb"))
        for k, letter in enumerate(letters)
    },
    "t4_tt_gof_tau": partial(_coefficient, torque_fit, "friction"),
    "t4_tt_gof_sigma": partial(_coefficient, torque_fit, "stiffness"),
    "eq19_intercept": constant_intercept,
    **{
        f"t5_{letter}_{name}": partial(_coefficient, partial(vibration_fit, planar), "intercept", k)
        for letter, planar in (("p", True), ("l", False))
        for name, k in (("c_i", 0), ("c_mu", 1), ("c_k", 2), ("gof", None))
        if planar or k != 2
    },
    **{
        f"t5_{name}": partial(_coefficient, partial(vibration_fit, True), "slope", k)
        for name, k in (("a_mu", 0), ("b_mu", 1), ("gof_b", None))
    },
}


def _of_slips(torque: str, vibration: str) -> dict[str, Callable[[], float]]:
    """Weight of torque, and the change of each standard deviation (%) by fusion of slips.

    With the standard deviations of table VI.
    """
    alone = [100.0 * r.slip_std for r in (TORQUE_SLIP[torque], VIBRATION_SLIP[vibration])]
    key, fused = f"t6_{torque[0]}{vibration[0]}", inverse_variance(np.zeros(2), np.asarray(alone))
    return {
        f"{key}_weight": lambda: fused.weights[0],
        f"{key}_std_t": lambda: fused.std - alone[0],
        f"{key}_std_v": lambda: fused.std - alone[1],
    }


def _of_soils(name: str, index: int, part: str) -> dict[str, Callable[[], float]]:
    """Weight of a sensor, and the change of standard deviation and mean error (%) by fusion.

    Three estimates of a property fused by eq. 30, with the standard deviations of table VIII; the
    mean error is that over all soils.
    """
    key, fused = f"t9_{'tvs'[index]}_{name}", pairwise(np.zeros(3), np.asarray(STD[name]))
    alone = abs(PRINTED[f"t8_{FUSED[index]}_all_soils_{part}_mean"])
    return {
        f"{key}_weight": lambda: fused.weights[index],
        f"{key}_std": lambda: fused.std - STD[name][index],
        f"{key}_mean": lambda: abs(fused_error("all_soils", part, name)) - alone,
    }


for _torque_name in TORQUE_SLIP:
    for _vibration_name in VIBRATION_SLIP:
        COMPUTED |= _of_slips(_torque_name, _vibration_name)
for _index in range(3):
    COMPUTED |= _of_soils("friction", _index, "phi") | _of_soils("stiffness", _index, "sigma")
del COMPUTED["t9_t_friction_mean"]  # smaller than what rounding leaves open
for _soil in ("ssc-1", "ssc-2", "ssc-3", "es-3"):
    COMPUTED[f"t10_true_{_soil}"] = partial(efficiency, _soil)
    COMPUTED[f"t10_mean_{_soil}"] = partial(characterised_efficiency, _soil)
for _torque_name in "ts":
    COMPUTED[f"t6_{_torque_name}l_mean_v"] = partial(_mean_by_others, _torque_name)
