"""Laws of the normal stress along the contact, and of what lies below."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, with_normal
from soilml.physics.effects.base import SlipLoadScaling, effect
from soilml.physics.gears.rigid_wheel import RigidWheel, largest_pressure, way_to_peak
from soilml.physics.gears.track import Track
from soilml.physics.gears.wheel import Wheel
from soilml.physics.load_case import LoadCase
from soilml.physics.soils import Soil

SMALLEST_SQUARE = 1e-30  # The root of nothing has no derivative


@dataclass(frozen=True, kw_only=True)
class StressShape(SlipLoadScaling):
    r"""A share of the normal stress has another shape between the ends of the contact.

    .. math::
        \sigma \leftarrow (1 - a) \sigma + a \sigma_m f(\xi), \quad
        \xi = \frac{\theta - \theta_m}{\theta_1 - \theta_m} \text{ before, }
        \frac{\theta_m - \theta}{\theta_m - \theta_2} \text{ behind the maximum}

    with sigma_m Bekker's pressure at the angle of the maximum. Not for `linear-wheel`, whose
    stresses are straight lines.
    """

    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (Wheel,)
    share: Annotated[Real, Parameter("1", 0.0, 1.0, "a, share of the shape")] = 0.0

    def shape(self, square: Array) -> Array:
        """f, from 1 - xi^2."""
        return square

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        """The stress with its share of the shape."""
        xp, soil = namespace(stress.normal), load_case.soil
        way = way_to_peak(stress.contact)
        other = self.shape(way * (2.0 - way)) * largest_pressure(stress.contact, soil)
        normal = stress.normal + self.scaled(self.share, load_case) * (other - stress.normal)
        return with_normal(stress, xp.maximum(normal, xp.zeros_like(normal)), soil)


@effect(
    "elliptic-pressure",
    source="Johnson, Contact Mechanics, 1985, sec. 4.2",
    kind="soil",
    reference={"share": 0.5},
    signs={"sinkage": -1},
    isolate="force sensors in the rim; sinkage at several loads and slips",
    family="shape of normal stress",
)
class EllipticPressure(StressShape):
    r"""Normal stress has the shape of an ellipse along the contact.

    .. math:: f = \sqrt{1 - \xi^2}

    in `StressShape`. References: Johnson, Contact
    Mechanics, 1985, section 4.2, pressure between a cylinder and an elastic plane (Hertz); that an
    ellipse reaches from each end of a soil contact to its maximum is ours. Not for
    `linear-wheel`, whose stresses are straight lines.
    """

    def shape(self, square: Array) -> Array:
        """The root of 1 - xi^2, which has a derivative at the ends too."""
        xp = namespace(square)
        return xp.sqrt(xp.maximum(square, xp.full_like(square, SMALLEST_SQUARE)))


@effect(
    "parabolic-pressure",
    source="Soehne 1953, Grundlagen der Landtechnik 5",
    kind="soil",
    reference={"share": 0.5},
    signs={"sinkage": -1},
    isolate="force sensors in the rim; sinkage at several loads and slips",
    family="shape of normal stress",
)
class ParabolicPressure(StressShape):
    r"""Normal stress has the shape of a parabola along the contact.

    .. math:: f = 1 - \xi^2

    in `StressShape`. References: Soehne, Grundlagen der
    Landtechnik 5, 1953, pressure under tyres as parabolas, of second degree on soft soil; that one
    reaches from each end of the contact to the maximum is ours. Bekker's pressure with n = 1 is
    close to it where the maximum is straight below the axle. Not for `linear-wheel`, whose stresses
    are straight lines.
    """


@dataclass(frozen=True, kw_only=True)
class PressureLaw(SlipLoadScaling):
    """A law of pressure against sinkage, the same at all slips and loads."""

    law_terms: ClassVar[tuple[str, ...]] = ()
    load_rises: ClassVar[bool] = True
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)


@effect(
    "saturating-pressure",
    source="Wong, Theory of Ground Vehicles, ch. 2; Kacigin and Guskov 1968",
    kind="soil",
    reference={"softness": 2e-5},
    signs={"sinkage": +1},
    isolate="plate tests to large sinkage; sinkage under a wide range of loads",
    family="pressure by sinkage",
)
class SaturatingPressure(PressureLaw):
    r"""Pressure approaches a limit with depth: heavy wheels sink further.

    .. math:: \sigma \leftarrow \frac{1 - e^{-a \sigma}}{a}, \qquad \sigma_\infty = 1 / a

    of Bekker's pressure, which it is at small depths; where n = 1 it is sigma_inf (1 - e^(-z /
    z_w)). References: Wong, Theory of Ground Vehicles, chapter 2, pressure on snow,
    p_w [1 - exp(-z / z_w)]; Kacigin and Guskov, J. Terramechanics 5(3), 1968, tanh in its place.
    The exponent n beside it is ours. A load near the limit has no equilibrium, and the row says so.
    """

    softness: Annotated[Real, Parameter("1/Pa", 0.0, 1e-3, "a, 1 / limit of pressure")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp = namespace(stress.normal)
        share = self.scaled(self.softness, load_case) * stress.normal
        share = xp.maximum(share, xp.full_like(share, 1e-30))  # the ratio has a limit at zero
        return with_normal(stress, stress.normal * (-xp.expm1(-share) / share), load_case.soil)


@effect(
    "firm-base",
    source="Wong, Theory of Ground Vehicles, ch. 2",
    kind="soil",
    reference={"nearness": 40.0},
    signs={"sinkage": -1},
    isolate="a plate or a rod pressed down to the base; heavier loads, which come nearer to it",
    family="pressure by sinkage",
)
class FirmBase(PressureLaw):
    r"""A firm base below loose soil stops the wheel.

    .. math:: \sigma \leftarrow \sigma [1 + (a z)^m], \qquad H = 1 / a

    with H the depth at which the base has doubled the pressure, and m its steepness. References:
    Wong, Theory of Ground Vehicles, chapter 2, layered terrain: pressure that rises again where the
    plate comes near a firm layer; the form is ours. Strength stays that of the loose soil. With all
    wheels far above the base it is a larger exponent n.
    """

    nearness: Annotated[Real, Parameter("1/m", 0.0, 500.0, "a, 1 / depth of the base")] = 0.0
    steepness: Annotated[Real, Parameter("1", 1.0, 12.0, "m, power of the depth")] = 4.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp, depth = namespace(stress.normal), stress.contact.depth
        near = self.scaled(self.nearness, load_case) * depth
        near = xp.maximum(near, xp.full_like(near, 1e-30))  # log(0) has no derivative
        firmer = 1.0 + xp.exp(self.steepness * xp.log(near))
        return with_normal(stress, stress.normal * firmer, load_case.soil)


@effect(
    "soft-crust",
    source="Wong, Theory of Ground Vehicles, ch. 2",
    kind="soil",
    reference={"deficit": 1500.0},
    signs={"sinkage": 1},
    isolate="a plate or a rod pressed down through the layer; lighter loads, which stay in it",
    family="pressure by sinkage",
)
class SoftCrust(PressureLaw):
    r"""A soft layer on firmer ground carries less than the ground.

    .. math:: \sigma \leftarrow \sigma - p_0 (1 - e^{-\sigma / p_0})

    with the deficit p_0: hardly any pressure where the ground below would bear less than p_0, and
    less by p_0 where it bears much more. References: Wong, Theory of Ground Vehicles, chapter 2,
    layered terrain; the form is ours: the integral of the missing bearing over a thin layer is a
    constant below it. Strength stays that of the ground. It does not hold for a wheel that stays
    within the layer, whose soil it is.
    """

    deficit: Annotated[Real, Parameter("Pa", 0.0, 50_000.0, "p0, pressure that is missing")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        xp = namespace(stress.normal)
        p0 = self.scaled(self.deficit, load_case) + 0.0 * stress.normal
        least = xp.maximum(p0, xp.full_like(p0, 1e-6))  # zero divides
        share = 1.0 - xp.exp(-stress.normal / least)
        return with_normal(stress, stress.normal - p0 * share, load_case.soil)


AT_WIDTH = 0.1  # Width (m) at which Reece's law and Bekker's have the same k_c and k_phi


@effect(
    "reece-width",
    source="Reece 1965, Proc. Inst. Mech. Eng. 180(2A)",
    kind="soil",
    reference={"share": 1.0},
    varied="wheels of several widths: with one it is a change of kc and kphi",
    varied_dimension="width",
    isolate="the same runs with a wheel of another width; plate tests with several plates",
    family="pressure by sinkage",
)
class ReeceWidth(SlipLoadScaling):
    r"""Pressure depends on sinkage over width: stiffness changes with width otherwise.

    .. math::
        \sigma = (k_1 + k_2 b) \left(\frac{z}{b}\right)^n
        = \left(\frac{k_1}{b} + k_2\right) b^{1 - n} z^n, \qquad
        k \leftarrow k \left(\frac{b}{b_0}\right)^{a (1 - n)}, \quad k \in \{k_c, k_\varphi\}

    with b_0 = 0.1 m: a = 1 is Reece's law, a = 0 Bekker's. References: Reece, Proc. Inst. Mech.
    Eng. 180(2A), 1965, k_1 = c k_c' and k_2 = gamma k_phi' / 2; Wong, Theory of Ground Vehicles,
    chapter 2. With gears of one width the two laws are the same, with other k_c and k_phi; and they
    are where n = 1.
    """

    law_terms: ClassVar[tuple[str, ...]] = ()
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel, Track)
    share: Annotated[Real, Parameter("1", 0.0, 2.0, "times the change from Bekker's law")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        width = load_case.gear.width + 0.0 * load_case.at.slip
        power = self.scaled(self.share, load_case) * (1.0 - soil.n)
        times = xp.exp(power * xp.log(width / AT_WIDTH))
        return replace(soil, kc=soil.kc * times, kphi=soil.kphi * times)


LARGE = 0.5  # Diameter (m) from which the curve of a plate holds for wheels


@effect(
    "small-wheel-stiffness",
    source="Meirion-Griffith and Spenko 2011, J. Terramechanics 48(2)",
    kind="soil",
    reference={"exponent": -0.3},
    signs={"sinkage": -1},
    varied="wheels of several diameters: with one it is a change of kc and kphi",
    varied_dimension="radius",
    isolate="the same runs with a wheel of another diameter; plate tests of the soil",
)
class SmallWheelStiffness(SlipLoadScaling):
    r"""The soil's stiffness depends on the diameter of the wheel.

    .. math:: \sigma = k z^n (D / D_0)^m, \quad D = 2 r, \quad D_0 = 0.5 m

    References: Meirion-Griffith and Spenko, J. Terramechanics 48(2), 2011, the pressure-sinkage
    model for small wheels, sigma = k z^n D^m; dividing by half a metre, above which they find
    Bekker's curve to hold, is ours and keeps the units of k. With wheels of one size it is a
    change of k_c and k_phi and of nothing else.
    """

    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    exponent: Annotated[Real, Parameter("1", -2.0, 0.0, "m, power of the diameter")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        diameter = 2.0 * load_case.gear.radius
        stiffer = xp.exp(self.scaled(self.exponent, load_case) * xp.log(diameter / LARGE))
        return replace(soil, kc=soil.kc * stiffer, kphi=soil.kphi * stiffer)
