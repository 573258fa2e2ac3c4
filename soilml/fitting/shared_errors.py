"""Errors that all rows share: their sizes, and those that the model itself is solved with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Real, namespace
from soilml.config.case import Case
from soilml.config.measurement_noise import EFFECT_OF_ERROR, KNOWN_PARTS, common_errors
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.effects.contact_shape import ExitAngle
from soilml.physics.gears.base import Gear
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.gears.rigid_wheel import WheelArc, entry_angle
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.physics.soils import Soil

#: Standard deviations of errors that the readings of a drive usually have in common: wheel speed
#: over ground speed, effective radius and gear ratios, current to torque, mass and load transfer,
#: the height at which the wheel touches the ground (m).
USUAL_SENSOR_ERRORS = {
    "slip_bias": 0.015,
    "load_gain": 0.01,
    "torque_gain": 0.03,
    "sinkage_bias": 0.0005,
}
PULL_OFFSET_SHARE = 0.01  # Usual offset of a sensor of drawbar pull as a share of a typical load
#: Usual standard deviations of the errors of a wheel's model. A bearing modulus is known to a
#: factor of 1.5. With slip it falls by slip-sinkage, n1 of about 0.2: k z^(n1 s) at z of 2 cm is
#: k exp(-0.8 s). With the logarithm of load it changes in soil of layers, or with an exponent that
#: is off by 0.2. The contact is that of `exit-angle` at its usual size. Models of sinkage and
#: drawbar pull are right to some per cent, of sinkage and of load. Stresses of another shape change
#: all three with slip: from a slip of 0.1 to 0.5 by 4 % of torque, 6 % of sinkage, 4 % of the load.
USUAL_MODEL_ERRORS = {
    "bearing": 0.4,
    "bearing_by_slip": 0.8,
    "bearing_by_load": 0.17,
    "contact": 1.0,
    "sinkage": 0.04,
    "drawbar_pull": 0.02,
    "torque_by_slip": 0.1,
    "sinkage_by_slip": 0.15,
    "drawbar_pull_by_slip": 0.1,
}

#: Usual standard deviations of errors of the laws of the soil, which act as another soil does: of
#: the logarithms of strength (cohesion and tan phi together), of its growth with log load, and of
#: the shear modulus. A law of another form is best fitted by a shear modulus 15 to 20 % off and a
#: friction angle 3 to 9 % off (`shear-softening`, stress falling to half beyond its peak), and
#: every third model has one: these are about half of that.
USUAL_LAW_ERRORS = {"strength": 0.02, "strength_by_load": 0.0175, "law_of_shear": 0.08}


def declared_errors(case: Case) -> dict[str, float]:
    """Errors of the sensors that the case declares in [bias], standard deviations by name."""
    return {name: std for name, std in common_errors(case.bias).items() if std > 0.0}


def usual_errors(case: Case, load: NDArray[np.float64], unknown: Sequence[str]) -> dict[str, float]:
    """Errors that sensors and a model usually have, standard deviations by name.

    A sensor that the case declares in [bias], or has as an effect, keeps that error; so does what
    is an unknown or an effect of the model.

    case: Model, soil and bias.
    load: Loads (n,) of the rows, N.
    unknown: Paths of the free parameters.
    """
    declared = common_errors(case.bias)
    effects = {
        effect.name for model in (case.model, *case.gears.values()) for effect in model.effects
    }
    usual = {**USUAL_SENSOR_ERRORS, "drawbar_pull_bias": PULL_OFFSET_SHARE * float(np.median(load))}
    of_sensors = {
        name: std
        for name, std in usual.items()
        if EFFECT_OF_ERROR[name] not in effects
        and not any(name in KNOWN_PARTS[key] for key in case.bias)
    }
    gears = [model.gear for model in (case.gears or {"": case.model}).values()]
    nil = without_errors(unknown, effects, gears)
    of_model = {name: std for name, std in USUAL_MODEL_ERRORS.items() if name not in nil}
    return {n: std for n, std in (declared | of_sensors | of_model).items() if std > 0.0}


def without_errors(
    unknown: Sequence[str], effects: Sequence[str] | set[str], gears: Sequence[Gear]
) -> set[str]:
    """Names of errors of the model that a model does not have: its unknowns and its effects."""
    nil = set()
    if "kphi" in unknown or "kc" in unknown:
        nil |= {"bearing"}
    if "n" in unknown:
        nil |= {"bearing_by_load"}
    if any(path.startswith("slip-sinkage") for path in unknown):
        nil |= {"bearing_by_slip"}
    if ExitAngle.name in effects or not all(ExitAngle.applies_to(gear) for gear in gears):
        nil |= {"contact"}
    if any(isinstance(gear, EmulatedGear) and "kphi" not in gear.inputs for gear in gears):
        nil |= {"bearing", "bearing_by_slip", "bearing_by_load"}  # the runs do not vary it
    return nil


LEAST, MOST = -50.0, 50.0  # Bounds of an error of size 1, far outside of what is looked for
TINY = 1e-12  # Smallest divisor (rad)


@final
@dataclass(frozen=True, kw_only=True)
class ModelledErrors(Effect):
    r"""Small errors of either sign; those of bearing are of its logarithm.

    .. math::
        s = s' + e_s, \quad W = W' (1 + e_W), \quad
        \ln \frac{k}{k'} = e_k + e_{ks} |s| + e_{kW} \ln\frac{W}{W_0}

    A contact error of e ends the contact of a wheel at e times the angle that `exit-angle` of usual
    size ends it at: ahead of the axle for a negative one, up to the angle of the largest stress,
    which is approached smoothly.
    """

    name: ClassVar[str] = "modelled-errors"
    about: ClassVar[EffectCard] = EffectCard(
        text="errors of slip, load, bearing and contact that all rows share",
        source="linear errors; Ishigami et al. 2007, J. Field Robotics 24(3), for the contact",
        kind="rig",
        reference={"slip_bias": 0.015},
        signs={},
        isolate="other sensors, other soils",
    )
    slip_bias: Annotated[Real, Parameter("1", LEAST, MOST, "true slip less that reported")] = 0.0
    load_gain: Annotated[Real, Parameter("1", LEAST, MOST, "true load over reported, less 1")] = 0.0
    bearing: Annotated[Real, Parameter("1", LEAST, MOST, "log of bearing modulus")] = 0.0
    bearing_by_slip: Annotated[Real, Parameter("1", LEAST, MOST, "its growth with slip")] = 0.0
    bearing_by_load: Annotated[Real, Parameter("1", LEAST, MOST, "its growth with log load")] = 0.0
    contact: Annotated[Real, Parameter("1", LEAST, MOST, "angle at exit over the usual one")] = 0.0
    typical_load: Annotated[Real, Parameter("N", 0.0, float("inf"), "W0")] = 1.0

    @classmethod
    def applies_to(cls, gear: Gear) -> bool:
        """Any gear: errors that it does not have are left out."""
        return True

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.slip)
        slip = at.slip + self.slip_bias
        most = xp.full_like(slip, MOST_SLIP)
        slip = xp.minimum(xp.maximum(slip, -most), most)
        return replace(at, slip=slip, load=at.load * (1.0 + self.load_gain))

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        at = load_case.at
        xp = namespace(at.slip)
        log = self.bearing + self.bearing_by_slip * xp.abs(at.slip)
        factor = xp.exp(log + self.bearing_by_load * xp.log(at.load / self.typical_load))
        return replace(soil, kc=soil.kc * factor, kphi=soil.kphi * factor)

    def on_contact(self, geometry: WheelArc, load_case: LoadCase) -> WheelArc:
        if not isinstance(geometry, WheelArc):
            return geometry
        xp = namespace(geometry.entry)
        kappa = ExitAngle.about.reference["kappa"]
        moved = -self.contact * entry_angle(kappa * geometry.sinkage, geometry.radius)
        room = geometry.peak - geometry.exit
        room = xp.maximum(room, xp.full_like(room, TINY))
        forward = xp.maximum(moved, xp.zeros_like(moved))
        ahead = forward / xp.sqrt(xp.sqrt(1.0 + (forward / room) ** 4))
        return replace(geometry, exit=geometry.exit + xp.where(moved < 0.0, moved, ahead))
