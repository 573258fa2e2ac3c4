"""Rate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress
from soilml.physics.effects.base import EffectCard, SlipLoadScaling, covariate
from soilml.physics.load_case import LoadCase

#: Speed (m/s) at which the soil's strength is as written, and the slowest that the law is for.
AT_SPEED, SLOWEST = 0.05, 1e-6


@final
@dataclass(frozen=True, kw_only=True)
class Rate(SlipLoadScaling):
    r"""The soil resists shear more, or less, the faster the wheel travels.

    .. math:: \tau \leftarrow \tau \left(1 + a \ln\frac{|v|}{v_0}\right), \quad v_0 = 0.05 m/s

    References: Mitchell and Soga, Fundamentals of Soil Behavior, 2005, chapter 12, strength by
    the logarithm of the rate of strain, some per cent to a tenth for each decade; taking the
    travel speed for the rate is ours. Not for standstill: below a micrometre per second the speed
    is taken as that, and shear stress never turns round.
    """

    name: ClassVar[str] = "rate"
    about: ClassVar[EffectCard] = EffectCard(
        text="shear strength changes with the travel speed",
        source="Mitchell and Soga 2005, ch. 12",
        kind="soil",
        reference={"a": 0.05},
        signs={},
        isolate="the same runs at another speed, ten times slower or faster",
        needs=("speed",),
    )
    a: Annotated[Real, Parameter("1", -0.3, 0.3, "growth per e-fold of speed")] = 0.0

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        speed = covariate(load_case, "speed", self.name)
        xp = namespace(speed)
        faster = xp.maximum(xp.abs(speed), xp.full_like(speed, SLOWEST)) / AT_SPEED
        factor = 1.0 + self.scaled(self.a, load_case) * xp.log(faster)
        return replace(stress, shear=stress.shear * xp.maximum(factor, xp.zeros_like(factor)))
