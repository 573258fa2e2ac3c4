"""Errors of all rows that the model itself is solved with: of slip, load, bearing and contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.effects.exit_angle import ExitAngle
from soilml.physics.gears.arc import entry_angle
from soilml.physics.gears.rigid_wheel import WheelArc
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.physics.soils import Soil

#: Bounds of an error of size 1, far outside of what is looked for.
LEAST, MOST = -50.0, 50.0
#: Smallest divisor (rad).
TINY = 1e-12


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
