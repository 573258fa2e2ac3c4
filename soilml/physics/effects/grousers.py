"""Grousers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class Grousers(SlipLoadScaling):
    r"""Lugs carry the soil between them around: it shears further out than the rim.

    .. math::
        r_s = r + \lambda h, \quad
        j = r_s [(\theta_1 - \theta) - (1 - s) \rho (\sin\theta_1 - \sin\theta)], \quad
        \rho = 1 - q \lambda h / r_s

    in the shear displacement j, and r_s in the lever arm of the torque. With q = 0, as the source
    prints it, j is that of a cylinder of radius r_s, and the slip must be that of the shearing
    radius, 1 - v / (r_s omega). With q = 1, the slip is reckoned with the rim's radius, as a rig
    does: the soil between the lugs then shears even at zero slip, because it is carried around
    faster than the wheel travels. For r = 0.15 m, h = 10 mm in dry sand under 60 N at s = 0.1 of
    the rim, T = 1.30 N m with q = 0 and 1.58 with q = 1. References: Ding, Gao, Deng, Nagatani and
    Yoshida, J. Terramechanics 48(1), 2011, shearing radius, lambda 0.5 to 1; j is the integral of
    r_s omega - v cos(theta) over time (Wong and Reece, J. Terramechanics 4(1), 1967).

    For lugs so close that the soil between them moves with the wheel. The passive thrust of single
    lugs (Wong, Theory of Ground Vehicles, chapter 2) is the other limit, for lugs far apart. The
    two must not be added. With all lugs at full passive failure that limit gives several times the
    measured drawbar pull of small lugged wheels.
    """

    name: ClassVar[str] = "grousers"
    about: ClassVar[EffectCard] = EffectCard(
        text="lugs carry the soil around: it shears further out than the rim",
        source="Ding et al. 2011, J. Terramechanics 48(1)",
        kind="wheel",
        reference={"height": 0.01},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="the same runs with a wheel without lugs; a dead-weight check of the torque sensor",
    )
    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    height: Annotated[Real, Parameter("m", 0.0, 0.2, "h, height of a lug above the rim")] = 0.0
    shearing: Annotated[Real, Parameter("1", 0.0, 1.0, "lambda, share of h added to r")] = 0.75
    rim_slip: Annotated[
        Real, Parameter("1", 0.0, 1.0, "q, 1: slip of the rim; 0: of the shear radius")
    ] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        out = self.shearing * self.scaled(self.height, load_case)
        shear_radius = rim.shear_radius + out
        return replace(
            rim,
            shear_radius=shear_radius,
            lever=rim.lever + out,
            travel=rim.travel * (1.0 - self.rim_slip * out / shear_radius),
        )
