"""The soil as it is at this slip, speed, pass or row: laws of its parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, mobilised_fraction, shear_direction
from soilml.physics.effects.base import SlipLoadScaling, covariate, effect
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import campaign_share
from soilml.physics.soils import Soil


@effect(
    "slip-sinkage",
    source="Ding et al. 2011, J. Terramechanics 48(1)",
    kind="soil",
    reference={"n1": 0.4},
    signs={"sinkage": +1},
    isolate="runs at several slips under one load, with sinkage measured",
)
class SlipSinkage(SlipLoadScaling):
    r"""A slipping wheel digs itself in: n grows with slip.

    .. math:: n = n_0 + n_1 |s|

    References: Ding, Gao, Deng, Nagatani and Yoshida, J. Terramechanics 48(1), 2011, the
    slip-dependent exponent. An empirical law for small lugged wheels in dry sand; it does not
    describe how long digging takes.
    """

    n1: Annotated[Real, Parameter("1", 0.0, 2.0, "growth of n per unit slip")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        xp = namespace(load_case.at.slip)
        return replace(soil, n=soil.n + self.scaled(self.n1, load_case) * xp.abs(load_case.at.slip))


@effect(
    "depth-cohesion",
    source="Lunar Sourcebook 1991, ch. 9",
    kind="soil",
    reference={"c1": 2e4},
    signs={"torque": +1, "drawbar_pull": +1, "sinkage": -1},
    isolate="shear tests of soil taken from several depths; a wide range of loads",
)
class DepthCohesion(SlipLoadScaling):
    r"""Cohesion grows with depth: more shear stress under deeper wheels.

    .. math:: c(z) = c + c_1 z, \qquad \tau \leftarrow \tau + c_1 z (1 - e^{-|j| / K})

    with z the depth that sets the pressure of a point, and the direction of tau on what is added.
    References: Carrier, Olhoeft and Mendell, Lunar Sourcebook, 1991, chapter 9, cohesion of
    regolith by depth; the straight line is ours. Where n = 1 pressure too is proportional to z,
    and no run distinguishes it from a larger friction angle.
    """

    c1: Annotated[Real, Parameter("Pa/m", 0.0, 1e6, "growth of cohesion with depth")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        contact = stress.contact
        xp = namespace(contact.depth)
        mobilised = mobilised_fraction(xp.abs(contact.shear_displacement), load_case.soil)
        cohesion = self.scaled(self.c1, load_case) * contact.depth
        more = shear_direction(contact, load_case.at) * cohesion * mobilised
        return replace(stress, shear=stress.shear + more)


#: Speed (m/s) at which the soil's strength is as written, and the slowest that the law is for.
AT_SPEED, SLOWEST = 0.05, 1e-6


@effect(
    "rate",
    source="Mitchell and Soga 2005, ch. 12",
    kind="soil",
    reference={"a": 0.05},
    isolate="the same runs at another speed, ten times slower or faster",
    needs=("speed",),
)
class Rate(SlipLoadScaling):
    r"""Shear strength changes with the travel speed.

    .. math:: \tau \leftarrow \tau \left(1 + a \ln\frac{|v|}{v_0}\right), \quad v_0 = 0.05 m/s

    References: Mitchell and Soga, Fundamentals of Soil Behavior, 2005, chapter 12, strength by
    the logarithm of the rate of strain, some per cent to a tenth for each decade; taking the
    travel speed for the rate is ours. Not for standstill: below a micrometre per second the speed
    is taken as that, and shear stress never turns round.
    """

    a: Annotated[Real, Parameter("1", -0.3, 0.3, "growth per e-fold of speed")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        speed = covariate(load_case, "speed", self.name)
        xp = namespace(speed)
        faster = xp.maximum(xp.abs(speed), xp.full_like(speed, SLOWEST)) / AT_SPEED
        factor = 1.0 + self.scaled(self.a, load_case) * xp.log(faster)
        return replace(stress, shear=stress.shear * xp.maximum(factor, xp.zeros_like(factor)))


@effect(
    "multipass",
    source="Holm 1969; Senatore and Sandu 2011, J. Terramechanics 48(4)",
    kind="soil",
    reference={"growth": 0.5},
    signs={"sinkage": -1},
    isolate="the same runs again in the same rut, and on soil prepared anew",
    needs=("pass_number",),
)
class Multipass(SlipLoadScaling):
    r"""Soil in a rut is firmer than virgin soil.

    .. math:: k \leftarrow k N^a, \quad k \in \{k_c, k_\varphi\}

    with N the number of the pass; sinkage is then measured from the bottom of the rut.
    References: Holm, J. Terramechanics 6, 1969, multi-pass behaviour of tyres; Senatore and
    Sandu, J. Terramechanics 48(4), 2011, soil parameters by pass. The power of N is ours: theirs
    are curves fitted to each soil. The slip of earlier passes has no influence, and density and
    shear strength remain those of virgin soil.
    """

    law_terms: ClassVar[tuple[str, ...]] = ("by_load",)
    growth: Annotated[Real, Parameter("1", 0.0, 3.0, "a, power of the pass number")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        passes = covariate(load_case, "pass_number", self.name)
        xp = namespace(passes)
        firmer = xp.exp(self.scaled(self.growth, load_case) * xp.log(passes))
        return replace(soil, kc=soil.kc * firmer, kphi=soil.kphi * firmer)


@dataclass(frozen=True, kw_only=True)
class Drift(SlipLoadScaling):
    """What changes with p, from 0 at the first row of a campaign to 1 at the last.

    By time where it is known, else by the order of the rows; where p is not known the campaign is
    over, p = 1. The soil of the model is that of the first row.
    """

    law_terms: ClassVar[tuple[str, ...]] = ()

    @final
    def so_far(self, change: Real, load_case: LoadCase) -> Array:
        """The share of a change in the whole campaign that has come about."""
        return self.scaled(change, load_case) * campaign_share(load_case.at)


@effect(
    "bearing-drift",
    source="Mitchell and Soga 2005, ch. 12",
    kind="soil",
    reference={"growth": 0.2},
    signs={"sinkage": -1},
    isolate="the first run again at the end of the campaign",
    uses=("progress",),
)
class BearingDrift(Drift):
    r"""The soil becomes firmer or softer during the campaign.

    .. math:: k \leftarrow k e^{a p}, \quad k \in \{k_c, k_\varphi\}

    with p as in `Drift`. References: Mitchell and Soga, Fundamentals of Soil Behavior, 2005,
    chapter 12, ageing and drying change stiffness; that it does so evenly is ours. Soil that is
    prepared anew before each run does not drift; whoever prepares it may.
    """

    growth: Annotated[Real, Parameter("1", -2.0, 2.0, "a, growth of ln k in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        growth = self.so_far(self.growth, load_case)
        firmer = namespace(growth).exp(growth)
        return replace(soil, kc=soil.kc * firmer, kphi=soil.kphi * firmer)


@effect(
    "cohesion-drift",
    source="Fredlund et al. 1978, Can. Geotech. J. 15(3)",
    kind="soil",
    reference={"gain": 500.0},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="the first run again at the end of the campaign; the moisture of the soil",
    uses=("progress",),
)
class CohesionDrift(Drift):
    r"""The soil gains or loses cohesion during the campaign: drying, wetting.

    .. math:: c \leftarrow \max(c + c_1 p, 0)

    with p as in `Drift`. References: Fredlund, Morgenstern and Widger, Can. Geotech. J. 15(3),
    1978, cohesion c' + (u_a - u_w) tan(phi_b), which grows with the suction u_a - u_w of a soil
    that dries; the straight line is ours. Friction and stiffness stay.
    """

    gain: Annotated[Real, Parameter("Pa", -1e4, 1e4, "c_1, gained in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        cohesion = soil.cohesion + self.so_far(self.gain, load_case)
        return replace(soil, cohesion=namespace(cohesion).maximum(cohesion, 0.0 * cohesion))


@effect(
    "friction-drift",
    source="Bolton 1986, Geotechnique 36(1)",
    kind="soil",
    reference={"gain": 0.05},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="the first run again at the end of the campaign; the density of the soil",
    uses=("progress",),
)
class FrictionDrift(Drift):
    r"""The friction angle grows or falls during the campaign: compaction, loosening.

    .. math:: \varphi \leftarrow \max(\varphi + \varphi_1 p, 0)

    with p as in `Drift`. References: Bolton, Geotechnique 36(1), 1986, the friction angle of sand
    grows with its relative density; that it does so evenly is ours. Cohesion and stiffness stay.
    """

    gain: Annotated[Real, Parameter("rad", -0.3, 0.3, "phi_1, gained in the campaign")] = 0.0

    def on_soil(self, soil: Soil, load_case: LoadCase) -> Soil:
        angle = soil.friction_angle + self.so_far(self.gain, load_case)
        return replace(soil, friction_angle=namespace(angle).maximum(angle, 0.0 * angle))
