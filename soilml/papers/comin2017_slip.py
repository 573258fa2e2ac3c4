"""The numbers that Comin and Saaj 2017 print on slip, soil, fusion and mobility, computed.

Torque-slip: `FOOT` in midstance under `LOAD` on the four soils at the five commanded slips.
Vibration-slip: legs of 3 to 6 kN/m on a soil of 40 degrees whose friction drops by 4 to 20 degrees
when it slips, at the four slips above zero. Pull efficiency: a wheel 0.18 m wide at a slip of 0.2.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from importlib import resources

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.fusion_rules import FusedEstimate, inverse_variance, pairwise
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import pull_efficiency
from soilml.physics.soils import soil
from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    SlipModelFit,
    TorqueSlip,
    VibrationSlip,
    fit_torque_slip,
    fit_vibration_slip,
)
from soilml.systems.wheel_legs.soil_errors import LINEAR, SIMPLIFIED, SINKAGE
from soilml.systems.wheel_legs.stances import (
    GRAVITY,
    SLIPS,
    SpringLeg,
    four_soils,
    midstance_torques,
    vibration_amplitude,
)

WIDTH, SLIP = 0.18, 0.2  # Width (m) and slip of the rover's wheel, neither printed
WHEEL, AT = Model(Wheel(radius=0.15, width=WIDTH)), Operating(slip=SLIP, load=50.0 * GRAVITY)
#: Springs to which the vibration-slip models are fitted: N/m, rad, and the friction angle.
STIFFNESSES = np.linspace(3000.0, 6000.0, 7)
DROPS = np.deg2rad(np.linspace(4.0, 20.0, 9))
FRICTION = math.radians(40.0)
#: Standard deviations (%) of the errors of torque, vibration and sinkage, table VIII, all soils.
STD = {
    name: tuple(one.scatter[k] for one in (SIMPLIFIED, LINEAR, SINKAGE))
    for k, name in enumerate(("friction", "stiffness"))
}


@cache
def torque_fit() -> SlipModelFit[TorqueSlip]:
    """The terramechanics form of table IV, on the four soils."""
    known = four_soils()
    return fit_torque_slip(
        midstance_torques(known),
        SLIPS,
        np.asarray(known.soil.friction_angle),
        known.normal_stiffness,
        "terramechanics",
    )


@cache
def vibrations() -> tuple[Floats, Floats, Floats]:
    """(vibration in m/s^2 (slips, springs), drop of friction, stiffness) of all springs."""
    stiffness, drop = (v.ravel() for v in np.meshgrid(STIFFNESSES, DROPS))
    vibration = vibration_amplitude(SpringLeg(stiffness=stiffness), SLIPS[1:, None], FRICTION, drop)
    return vibration, drop, stiffness


@cache
def vibration_fit(planar: bool) -> SlipModelFit[VibrationSlip]:
    """Table V fitted to the rotating spring."""
    vibration, drop, stiffness = vibrations()
    return fit_vibration_slip(vibration, SLIPS[1:], drop, stiffness, planar)


def fused_slip(torque: str, vibration: str) -> FusedEstimate:
    """Fused slip from torque and vibration, with the standard deviations of table VI (in %)."""
    std = 100.0 * np.asarray([TORQUE_SLIP[torque].slip_std, VIBRATION_SLIP[vibration].slip_std])
    return inverse_variance(np.zeros(2), std)


def fused_soil(name: str) -> FusedEstimate:
    """Three estimates of a property fused by eq. 30, with the std of table VIII (%)."""
    return pairwise(np.zeros(3), np.asarray(STD[name]))


@cache
def efficiency(name: str) -> float:
    """Pull efficiency (%) of a wheel of the 300 kg rover, one of six, on a soil of table I."""
    return 100.0 * float(pull_efficiency(WHEEL, soil(f"comin2017/{name}"), AT))


def constant_intercept() -> float:
    """Mean intercept of the empirical model over the four soils of table I."""
    known = four_soils()
    angle = np.asarray(known.soil.friction_angle)
    a, _ = TORQUE_SLIP["empirical"].line(angle, known.normal_stiffness)
    return float(a.mean())


def _torque(part: str, index: int) -> float:
    coefficients: tuple[float, float, float] = getattr(torque_fit().law, part)
    return coefficients[index]


def _weight(torque: str, vibration: str) -> float:
    return float(fused_slip(torque, vibration).weights[0])


def _slip_gain(torque: str, vibration: str, index: int) -> float:
    single = (TORQUE_SLIP[torque].slip_std, VIBRATION_SLIP[vibration].slip_std)[index]
    return float(fused_slip(torque, vibration).std) - 100.0 * single


def _soil_weight(name: str, index: int) -> float:
    return float(fused_soil(name).weights[index])


def _soil_gain(name: str, index: int) -> float:
    return float(fused_soil(name).std) - STD[name][index]


def _vibration(planar: bool, name: str) -> float:
    return float(getattr(vibration_fit(planar).law, name))


def _goodness(
    fit: Callable[[], SlipModelFit[TorqueSlip] | SlipModelFit[VibrationSlip]], part: str
) -> float:
    return fit().goodness[part]


@cache
def printed() -> dict[str, float]:
    """The numbers of this chapter's table of numbers, by key."""
    text = resources.files("soilml.papers").joinpath("comin2017_slip.csv").read_text("utf-8")
    return {row["key"]: float(row["published"]) for row in csv.DictReader(text.splitlines())}


#: Models of table VIII of which table IX fuses the estimates, in the order of its weights.
FUSED = ("ts", "vl", "s")


def fused_error(ground: str, part: str, name: str) -> float:
    """Mean error (%) of a property on a soil: the weights of table IX on errors of table VIII."""
    weights = (printed()[f"t9_{sense}_{name}_weight"] for sense in "tvs")
    errors = (printed()[f"t8_{model}_{ground}_{part}_mean"] for model in FUSED)
    return sum(w * e for w, e in zip(weights, errors, strict=True))


def _error_gain(sense: int, part: str, name: str) -> float:
    """Change of the size of the mean error (%) by fusion, over all soils."""
    alone = printed()[f"t8_{FUSED[sense]}_all_soils_{part}_mean"]
    return abs(fused_error("all_soils", part, name)) - abs(alone)


@cache
def characterised_efficiency(name: str) -> float:
    """Pull efficiency (%) on a soil of table I with the fused mean errors of its properties."""
    known = soil(f"comin2017/{name}")
    angle = 1.0 + fused_error(name, "phi", "friction") / 100.0
    stiffness = 1.0 + fused_error(name, "sigma", "stiffness") / 100.0
    found = replace(known, friction_angle=known.friction_angle * angle, kphi=known.kphi * stiffness)
    return 100.0 * float(pull_efficiency(WHEEL, found, AT))


def _mean_by_others(torque: str) -> float:
    """Change of the mean error of vibration, linear, from the printed ones of other pairs.

    The change of torque less that of vibration is the difference of their own mean errors, which
    the empirical model shows for both models of vibration.
    """

    def apart(pair: str) -> float:
        return printed()[f"t6_{pair}_mean_t"] - printed()[f"t6_{pair}_mean_v"]

    between = apart("el") - apart("ep")
    return printed()[f"t6_{torque}l_mean_t"] - (apart(f"{torque}p") + between)


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    "t4_tt_c_tau": partial(_torque, "friction", 0),
    "t4_tt_b_tau": partial(_torque, "friction", 1),
    "t4_tt_a_tau": partial(_torque, "friction", 2),
    "t4_tt_gof_tau": partial(_goodness, torque_fit, "friction"),
    "t4_tt_c_sigma": partial(_torque, "stiffness", 0),
    "t4_tt_b_sigma": partial(_torque, "stiffness", 1),
    "t4_tt_gof_sigma": partial(_goodness, torque_fit, "stiffness"),
    "eq19_intercept": constant_intercept,
    "t5_p_gof": partial(_goodness, partial(vibration_fit, True), "intercept"),
    "t5_l_gof": partial(_goodness, partial(vibration_fit, False), "intercept"),
    "t5_gof_b": partial(_goodness, partial(vibration_fit, True), "slope"),
    "t5_a_mu": partial(_vibration, True, "a_mu"),
    "t5_b_mu": partial(_vibration, True, "b_mu"),
}
for _name, _key in (("c_i", "c_i"), ("c_mu", "c_mu"), ("c_k", "c_k")):
    COMPUTED[f"t5_p_{_key}"] = partial(_vibration, True, _name)
for _name in ("c_i", "c_mu"):
    COMPUTED[f"t5_l_{_name}"] = partial(_vibration, False, _name)
for _t, _torque_name in zip("tes", TORQUE_SLIP, strict=True):
    for _v, _vibration_name in zip("pl", VIBRATION_SLIP, strict=True):
        _key = f"t6_{_t}{_v}"
        COMPUTED[f"{_key}_weight"] = partial(_weight, _torque_name, _vibration_name)
        COMPUTED[f"{_key}_std_t"] = partial(_slip_gain, _torque_name, _vibration_name, 0)
        COMPUTED[f"{_key}_std_v"] = partial(_slip_gain, _torque_name, _vibration_name, 1)
for _name in STD:
    for _index, _sense in enumerate("tvs"):
        COMPUTED[f"t9_{_sense}_{_name}_weight"] = partial(_soil_weight, _name, _index)
        COMPUTED[f"t9_{_sense}_{_name}_std"] = partial(_soil_gain, _name, _index)
        if (_sense, _name) != ("t", "friction"):  # smaller than what rounding leaves open
            COMPUTED[f"t9_{_sense}_{_name}_mean"] = partial(
                _error_gain, _index, "phi" if _name == "friction" else "sigma", _name
            )
for _soil in ("ssc-1", "ssc-2", "ssc-3", "es-3"):
    COMPUTED[f"t10_true_{_soil}"] = partial(efficiency, _soil)
    COMPUTED[f"t10_mean_{_soil}"] = partial(characterised_efficiency, _soil)
for _torque_name in "ts":
    COMPUTED[f"t6_{_torque_name}l_mean_v"] = partial(_mean_by_others, _torque_name)
