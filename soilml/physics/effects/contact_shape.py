"""Where a wheel touches the soil: ends of the contact, peak of the stress, shape of the rim."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from soilml.arrays import Real, namespace, to_numpy
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.physics.effects.base import SlipLoadScaling, effect
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc, entry_angle
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase


@effect(
    "exit-angle",
    source="Ishigami et al. 2007, J. Field Robotics 24(3); Ding et al. 2011",
    kind="soil",
    reference={"kappa": 0.15},
    signs={"drawbar_pull": +1, "sinkage": -1},
    isolate="runs near zero slip; the wheel weighed on its stand",
)
class ExitAngle(SlipLoadScaling):
    r"""The rim touches the soil behind the axle too: theta_2 below zero.

    .. math:: \theta_2 = -\arccos(1 - \kappa z / r) + b_0 \theta_1

    Give one of the two forms; both are refused. The angle is about sqrt(kappa) theta_1: a tenth of
    kappa is a third of the angle. Behind the axle the shear of a driving wheel pulls it down. The
    wider contact mostly lifts the wheel, but in some 4 % of the driving rows of the box of
    the tests (kappa 0.15) it sinks deeper. Under a braking wheel whose contact is nearly
    symmetric (kappa = 1, b0 = -1) the law "slip-sign" can yield power instead of spending it: do
    not brake with such values by that law. References: kappa, Ishigami, Miwa, Nagatani and Yoshida,
    J. Field Robotics 24(3), 2007; b0, Ding et al. 2011. For wheels.
    """

    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    kappa: Annotated[Real, Parameter("1", 0.0, 1.0, "height at exit / sinkage")] = 0.0
    b0: Annotated[Real, Parameter("1", -1.0, 0.0, "theta_2 / theta_1")] = 0.0

    def __post_init__(self) -> None:
        if np.any((to_numpy(self.kappa) != 0.0) & (to_numpy(self.b0) != 0.0)):
            raise InputError("exit-angle takes kappa or b0, and both are given: leave one at 0")

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        kappa = xp.minimum(
            self.scaled(self.kappa, load_case) + 0.0 * rim.entry, xp.ones_like(rim.entry)
        )
        behind = -entry_angle(kappa * rim.sinkage, rim.radius)
        return replace(rim, exit=rim.exit + behind + self.b0 * rim.entry)


@effect(
    "stress-shift",
    source="Nagatani et al. 2009, IROS, sec. IV",
    kind="soil",
    reference={"shift": 0.2},
    signs={"drawbar_pull": -1, "sinkage": +1},
    isolate="force sensors in the rim; the same soil under a larger wheel",
)
class StressShift(SlipLoadScaling):
    r"""Stresses sit at the front of the contact: small wheels.

    .. math::
        \theta \leftarrow \theta + a (\theta_1 - \theta), \quad
        \theta \in \{\theta_m, \theta_2\}

    so that the arc keeps the share 1 - a of its length. References: Nagatani, Ikeda, Sato and
    Yoshida, IROS 2009, section IV: of 70 degrees of contact 30 carry stress, a = 0.57. The stress
    there also moves on with slip (`by_slip`); that all angles move by one rule is our reading.
    Pressure is still Bekker's at the depth of each point, so that a shorter arc further up must
    sink to carry its load. Not for wheels above half a metre.
    """

    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    shift: Annotated[Real, Parameter("1", 0.0, 0.9, "share of the way to the entry angle")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        shift = self.scaled(self.shift, load_case)
        return replace(
            rim,
            peak=rim.peak + shift * (rim.entry - rim.peak),
            exit=rim.exit + shift * (rim.entry - rim.exit),
        )


@effect(
    "wheel-flexibility",
    source="Bekker 1969; Schmid 1995, J. Terramechanics 32(1)",
    kind="wheel",
    reference={"compliance": 2e-5},
    signs={"drawbar_pull": +1, "sinkage": -1},
    isolate="pressing the wheel on a flat plate and measuring how far the axle comes down",
    family="flexible rim",
)
class WheelFlexibility(SlipLoadScaling):
    r"""The wheel deflects under its load and touches along a longer arc.

    .. math::
        r^* = r (1 + \delta / z), \quad \delta = C W, \quad
        \theta_1 = \arccos(1 - z / r^*)

    The substitute circle has, at small angles, the contact length of the deflected wheel,
    sqrt(2 r (z + delta)); peak and exit keep their share of the entry angle, the torque its lever
    r. References: Bekker, Introduction to Terrain-Vehicle Systems, 1969; Schmid, J. Terramechanics
    32(1), 1995, substitute circle. That the wheel is a linear spring is ours. Not for deflections
    of the order of the radius, nor for a rim that lies flat (`flat-rim`).
    """

    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    compliance: Annotated[Real, Parameter("m/N", 0.0, 1e-2, "C, deflection per load")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        deflection = self.scaled(self.compliance, load_case) * load_case.at.load
        larger = 1.0 + deflection / rim.sinkage
        radius = rim.radius * larger
        entry = entry_angle(rim.sinkage, radius)
        return rim.with_entry(entry, radius=radius, shear_radius=rim.shear_radius * larger)


MOST_DEFLECTION = 0.3  # Largest deflection, as a fraction of the radius


@effect(
    "flat-rim",
    source="Bekker 1969; Wong, Theory of Ground Vehicles, ch. 2",
    kind="wheel",
    reference={"compliance": 2e-5},
    signs={"drawbar_pull": +1, "sinkage": -1},
    isolate="pressing the wheel on a flat plate and measuring how far the axle comes down",
    family="flexible rim",
)
class FlatRim(SlipLoadScaling):
    r"""The rim gives way and lies flat on the soil along a chord.

    .. math::
        \delta = C W, \quad \theta_c = \arccos(1 - \delta / r), \quad
        \theta_1 = \arccos(1 - (z + \delta) / r), \quad \theta_2 \leftarrow \theta_2 - \theta_c

    z is the sinkage of the chord. Between -theta_c and theta_c the rim is level: it pushes no soil
    ahead, and its normal stress has a lever arm about the axle. References: Bekker, Introduction to
    Terrain-Vehicle Systems, 1969, and Wong, Theory of Ground Vehicles, chapter 2, the flexible
    wheel as a level chord behind an arc of its own radius. Theirs is pressed uniformly; that the
    pressure falls to the rear end as Wong and Reece have it, so that C = 0 is the rigid wheel, and
    the linear spring are ours. `wheel-flexibility` is the other form, a larger circle. Not for
    deflections above 0.3 of the radius.
    """

    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    compliance: Annotated[Real, Parameter("m/N", 0.0, 1e-2, "C, deflection per load")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        deflection = self.scaled(self.compliance, load_case) * load_case.at.load
        if not bool(xp.any(deflection > 0.0)):
            return rim
        most = MOST_DEFLECTION * rim.radius + 0.0 * deflection
        deflection = xp.minimum(deflection, most) + 0.0 * rim.entry
        entry = entry_angle(rim.sinkage + deflection, rim.radius)
        chord = entry_angle(deflection, rim.radius)
        return rim.with_entry(entry, exit=rim.exit - chord, chord=chord)


@effect(
    "clogging",
    source="Ding et al. 2011, J. Terramechanics 48(1), radius of shearing",
    kind="wheel",
    reference={"layer": 0.003},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="measure the lugs; the same runs with the wheel brushed clean before each",
)
class Clogging(SlipLoadScaling):
    r"""A larger wheel: soil on the rim or between lugs, or lugs, with the slip of the rim.

    .. math::
        r \leftarrow r + h, \quad \theta_1 = \arccos(1 - z / (r + h)), \quad
        \frac{v}{(r + h) \omega} = (1 - s) \frac{r}{r + h}

    in the pressure, the shear displacement and the lever arm of the torque, with s the slip of the
    clean rim, as a rig reckons it, and z the sinkage of the layer. References: Ding et al., J.
    Terramechanics 48(1), 2011, the radius r + lambda h of shearing around lugs, here with lambda =
    1 and in all of the contact; definition of slip. That the layer turns with the wheel and is as
    strong as the soil is ours. Lugs on a wheel whose slip is that of the rim look much the same:
    `grousers` with rim_slip = 1. Lugs of which `grousers` has the shear already count once more
    beside it: give it the part of h that clogs beyond theirs. Not for soil that falls off again
    within a turn.
    """

    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    layer: Annotated[Real, Parameter("m", 0.0, 0.1, "h, thickness of the layer of soil")] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        layer = self.scaled(self.layer, load_case)
        radius, shear_radius = rim.radius + layer, rim.shear_radius + layer
        return rim.with_entry(
            entry_angle(rim.sinkage, radius),
            radius=radius,
            shear_radius=shear_radius,
            lever=rim.lever + layer,
            travel=rim.travel * (rim.shear_radius / shear_radius),
        )
