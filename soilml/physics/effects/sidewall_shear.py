"""Sidewall shear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, cast, final

from soilml.arrays import Array, Real, namespace
from soilml.numerics.quadrature import columns, gauss
from soilml.parameters import Parameter
from soilml.physics.contact import Force, mobilised_fraction
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel, displacement_direction, displacement_slip
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class SidewallShear(SlipLoadScaling):
    r"""The two side walls of the wheel shear the soil that they are buried in.

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

    name: ClassVar[str] = "sidewall-shear"
    about: ClassVar[EffectCard] = EffectCard(
        text="the buried side walls shear the soil too: more torque and pull",
        source="geometry; Jaky 1944; Janosi and Hanamoto 1961",
        kind="soil",
        reference={"share": 1.0},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="the same runs with a wheel of another width; heavier loads, which bury more wall",
    )
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
