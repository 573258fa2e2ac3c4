"""Forces beside the stress under the wheel: soil in front, sides, slopes, bearings."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, cast

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import columns, gauss
from soilml.parameters import Parameter
from soilml.physics.contact import Force, Stress, mobilised_fraction, travel_ratio
from soilml.physics.effects.base import Effect, SlipLoadScaling, covariate, effect
from soilml.physics.gears.rigid_wheel import (
    RigidWheel,
    WheelArc,
    displacement_direction,
    displacement_slip,
)
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating


@effect(
    "bulldozing",
    source="Bekker 1969; Wong, Theory of Ground Vehicles, ch. 2",
    kind="soil",
    reference={"share": 1.0},
    signs={"drawbar_pull": -1},
    isolate="the same runs driven the other way, which turns a slope around; heavier loads",
)
class Bulldozing(SlipLoadScaling):
    r"""The wheel pushes a wall of soil before it: less drawbar pull.

    .. math::
        R = b (0.67 c z K_c + \tfrac12 z^2 \gamma K_\gamma), \quad
        K_c = (N_c - \tan\varphi') \cos^2\varphi', \quad
        K_\gamma = \left(\frac{2 N_\gamma}{\tan\varphi'} + 1\right) \cos^2\varphi', \quad
        \tan\varphi' = \tfrac23 \tan\varphi

    with the bearing capacity factors N_q and N_c of Prandtl and Reissner and N_gamma of Vesic.
    References: Bekker 1969 and Wong, Theory of Ground Vehicles, chapter 2, eqs. for bulldozing
    resistance in local shear failure. `share` scales it: 1 is the formula. It pulls back whichever
    way the wheel slips.
    """

    share: Annotated[Real, Parameter("1", 0.0, 5.0, "times the formula's resistance")] = 0.0

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        xp = namespace(force.load)
        soil = load_case.soil
        tan = 2.0 / 3.0 * xp.tan(soil.friction_angle)
        tan = xp.maximum(tan, xp.full_like(tan, 1e-6))  # the factors have limits at phi = 0
        cos2 = 1.0 / (1.0 + tan * tan)
        angle = xp.atan(tan)
        n_q = xp.exp(math.pi * tan) * xp.tan(math.pi / 4.0 + 0.5 * angle) ** 2
        k_c = ((n_q - 1.0) / tan - tan) * cos2
        k_gamma = (4.0 * (n_q + 1.0) + 1.0) * cos2  # N_gamma / tan = 2 (N_q + 1), Vesic
        width = load_case.gear.width
        z = force.sinkage
        resistance = width * (
            0.67 * soil.cohesion * z * k_c + 0.5 * z * z * soil.unit_weight * k_gamma
        )
        share = self.scaled(self.share, load_case)
        return replace(force, drawbar_pull=force.drawbar_pull - share * resistance)


@effect(
    "sidewall-shear",
    source="geometry; Jaky 1944; Janosi and Hanamoto 1961",
    kind="soil",
    reference={"share": 1.0},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="the same runs with a wheel of another width; heavier loads, which bury more wall",
)
class SidewallShear(SlipLoadScaling):
    r"""The buried side walls shear the soil too: more torque and pull.

    .. math::
        A = \tfrac12 r^2 (\theta_1 - \sin\theta_1 \cos\theta_1), \quad
        y = \frac{2 r \sin^3\theta_1}{3 (\theta_1 - \sin\theta_1 \cos\theta_1)}, \quad
        \tau = [c + K_0 \gamma (y - r \cos\theta_1) \tan\varphi] (1 - e^{-|j| / K})

        T \leftarrow T + 2 a \tau A y, \quad DP \leftarrow DP + 2 a \tau A, \quad
        j = r [\theta_1 - (1 - s) \sin\theta_1], \quad K_0 = 1 - \sin\varphi

    A is the half segment in front of the axle, y its centroid below the axle; tau has the sign of
    j, in which 1 / (1 + s) takes the place of 1 - s while braking. By the wheel's law "slip-sign"
    it has the sign of the slip, and 1 - s stays. References: Jaky 1944, earth pressure at rest K_0;
    the rest is geometry and Janosi and Hanamoto 1961, put together by us. The stress is taken level
    and alike all over the wall, its part of the vertical load is left out; not for walls with
    spokes or soil inside.
    """

    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    share: Annotated[Real, Parameter("1", 0.0, 5.0, "times the formula's shear")] = 0.0

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        soil, slip, entry = load_case.soil, load_case.at.slip, force.entry_angle
        xp = namespace(entry)
        radius = load_case.gear.radius
        area, depth = buried(entry)
        sin = xp.sin(entry)
        pressure = (1.0 - xp.sin(soil.friction_angle)) * soil.unit_weight * radius * depth
        strength = soil.cohesion + pressure * xp.tan(soil.friction_angle)
        law = cast("RigidWheel", load_case.gear).braking
        moved = radius * (entry - (1.0 - displacement_slip(slip, law)) * sin)
        direction = displacement_direction(moved, slip, law)
        shear = direction * strength * mobilised_fraction(xp.abs(moved), soil)
        pull = 2.0 * self.scaled(self.share, load_case) * shear * radius**2 * area
        lever = radius * (depth + xp.cos(entry))
        return replace(
            force, torque=force.torque + pull * lever, drawbar_pull=force.drawbar_pull + pull
        )


def buried(entry: Array) -> tuple[Array, Array]:
    r"""Area and mean depth of the half segment of a circle of radius 1, by entry angle (rad).

    .. math::
        A = \int_0^{\theta_1} \sin^2 t \, dt, \quad
        A d = \int_0^{\theta_1} \sin^2 t (\cos t - \cos\theta_1) dt

    by quadrature, whose digits do not cancel in a shallow rut as those of the closed forms do.
    """
    xp = namespace(entry)
    share, weight = columns(gauss(12), entry)
    t = share * entry
    strip = weight * entry * xp.sin(t) ** 2
    below = 2.0 * xp.sin(0.5 * (entry + t)) * xp.sin(0.5 * (entry - t))
    area = xp.sum(strip, axis=0)
    return area, xp.sum(strip * below, axis=0) / area


@effect(
    "lateral-slip",
    source="Yoshida and Ishigami 2004, IROS; Ishigami et al. 2007",
    kind="soil",
    reference={"share": 1.0},
    signs={"torque": -1, "drawbar_pull": -1},
    isolate="the same runs with the wheel held straight, and at several slip angles",
    needs=("slip_angle",),
)
class LateralSlip(SlipLoadScaling):
    r"""Sliding sideways uses up shear strength that would drive.

    .. math::
        j_y = a (1 - s) \tan\beta \; r (\theta_1 - \theta), \quad j = \sqrt{j_x^2 + j_y^2}, \quad
        \tau_x = (c + \sigma \tan\varphi) (1 - e^{-j / K}) \frac{|j_x|}{j}

    with the direction of the gear's shear stress on tau_x. While a wheel brakes, its travel ratio
    1 / (1 + s) takes the place of 1 - s, unless its law is "slip-sign". References: Yoshida and
    Ishigami, IROS 2004, eqs. for the lateral shear displacement; Ishigami et al., J. Field Robotics
    24(3), 2007. They let each direction reach its full strength by itself (tau_x from j_x alone,
    tau_y from j_y alone); here both share one strength, and `share` 0 is the former. A `share`
    above 1 stands for soil that the flank of the wheel pushes along. The side force itself is no
    output.
    """

    share: Annotated[Real, Parameter("1", 0.0, 5.0, "times the sideways displacement")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        contact, modulus = stress.contact, load_case.soil.shear_modulus
        beta = covariate(load_case, "slip_angle", self.name)
        xp = namespace(contact.shear_displacement)
        travelled = travel_ratio(contact, load_case.at)
        aside = self.scaled(self.share, load_case) * travelled * xp.tan(beta)
        aside = aside * contact.surface_travel
        ahead = xp.maximum(xp.abs(contact.shear_displacement), xp.full_like(aside, 1e-30))
        both = xp.where(aside == 0, ahead, xp.hypot(ahead, aside))
        # forward stress of the whole displacement over that of its forward part alone
        factor = (xp.expm1(-both / modulus) / both) / (xp.expm1(-ahead / modulus) / ahead)
        return replace(stress, shear=stress.shear * factor)


@effect(
    "bearing-friction",
    source="Coulomb friction",
    kind="rig",
    reference={"coefficient": 0.01},
    signs={"torque": +1},
    isolate="turning the wheel, loaded, on a smooth roller or a second bearing",
    calibration=0.005,
)
class BearingFriction(Effect):
    r"""Friction of the bearing is in the measured torque.

    .. math:: T' = T + \mu W r

    References: Coulomb friction of a bearing, its coefficient here referred to the radius of the
    wheel and not to that of the shaft. Whether the wheel drives or brakes, it turns forward and the
    friction is on the motor. Not for seals and gears, whose friction the load does not change.
    """

    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    coefficient: Annotated[Real, Parameter("1", 0.0, 0.3, "mu, referred to r")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        radius = load_case.gear.radius
        return replace(force, torque=force.torque + self.coefficient * load_case.at.load * radius)


@effect(
    "slope",
    source="statics of a body on a slope",
    kind="rig",
    reference={"angle": 0.0175},
    signs={"drawbar_pull": -1},
    isolate="the same runs driven the other way; a spirit level on the bed",
    calibration=0.005,
)
class Slope(Effect):
    r"""The bed is inclined: weight pulls the wheel back, or forward in reverse.

    .. math:: W = W' \cos\alpha, \quad DP' = DP - d W' \sin\alpha

    with primes for what is reported and d = -1 where the travel speed is given and below zero,
    else 1. References: statics of a body on a slope, as in Wong, Theory of Ground Vehicles,
    chapter 3. The soil is treated as on level ground: valid for slopes of some degrees, not for
    those on which the soil itself is close to sliding.
    """

    angle: Annotated[Real, Parameter("rad", -0.5, 0.5, "uphill is positive")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        return replace(at, load=at.load * xp.cos(self.angle + 0.0 * at.load))

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        load, speed = load_case.at.load, load_case.at.speed  # the load across the slope by now
        xp = namespace(load)
        along = load * xp.tan(self.angle + 0.0 * load)
        if speed is not None:
            along = xp.where(speed < 0, -along, along)
        return replace(force, drawbar_pull=force.drawbar_pull - along)


@effect(
    "load-transfer",
    source="moments about the rig's arm",
    kind="rig",
    reference={"ratio": 0.1},
    isolate="weighing the wheel on its stand while the drawbar is pulled by hand",
    calibration=0.03,
)
class LoadTransfer(Effect):
    r"""Drawbar pull presses the wheel down, or lifts it, past the load cell.

    .. math:: W = W' + \frac{h}{L} DP + W_0

    with W' as reported, h the height of the drawbar above the axle of the rig's arm and L its
    length. References: moments about the arm's joint; Wong, Theory of Ground Vehicles, chapter 3,
    load transfer by drawbar pull. The soil has to carry W, which the search for equilibrium
    balances; effects on drawbar pull that stand behind it in the model transfer no load. A load
    that the constant part would take below zero is a wheel that barely touches, 1 uN.
    """

    ratio: Annotated[Real, Parameter("1", -0.5, 0.5, "h / L, load gained per pull")] = 0.0
    offset: Annotated[Real, Parameter("N", -100.0, 100.0, "W0, load gained always")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        load = at.load + self.offset
        return replace(at, load=xp.maximum(load, xp.full_like(load, 1e-6)))

    def on_force(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, load=force.load - self.ratio * force.drawbar_pull)


@effect(
    "camber",
    source="geometry; slices across the width",
    kind="rig",
    reference={"angle": 0.15},
    signs={"sinkage": -1},
    isolate="a spirit level on the side of the wheel, under load",
    calibration=0.03,
)
class Camber(Effect):
    r"""The wheel is inclined to the side: one edge digs in.

    .. math::
        F = \frac{1}{b} \int_{-b/2}^{b/2} F(z + y \sin\gamma) dy
        \approx \tfrac12 [F(z + d) + F(z - d)], \quad d = \frac{b \sin\gamma}{\sqrt{12}}

    for each force F of an upright wheel, with z the sinkage of the middle of the rim; in the
    wheel's plane the load is W / cos(gamma). References: slices across the width, with the two
    nodes of Gauss and Legendre. What changes is of the order of gamma squared, and large where the
    wheel is wide for its sinkage. The angle is alike to both sides. Side forces, and soil that is
    heaped up beside the wheel, are left out.
    """

    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    angle: Annotated[Real, Parameter("rad", 0.0, 0.5, "gamma, of the wheel's plane")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        xp = namespace(at.load)
        return replace(at, load=at.load / xp.cos(self.angle + 0.0 * at.load))

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        xp = namespace(rim.entry)
        tilt = rim.width / math.sqrt(12.0) * xp.sin(self.angle + 0.0 * rim.entry)
        return replace(rim, tilt=tilt) if bool(xp.any(tilt > 0.0)) else rim
