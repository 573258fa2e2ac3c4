"""Operating conditions of a steady run, and the soil's known shear strength."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

from soilml.arrays import Real
from soilml.parameters import Parameter, check
from soilml.physics.operating_point import MOST_SLIP


@final
@dataclass(frozen=True, kw_only=True)
class SteadyRun:
    """A steady run up a slope, with the standard deviations of the measured quantities.

    The wheel carries weight cos(slope) and pulls weight sin(slope): Nagatani et al. 2009, eqs. 14
    and 15. Valid for a rover whose wheels share weight and pull equally.
    """

    slip: Annotated[Real, Parameter("1", -MOST_SLIP, MOST_SLIP, "slip ratio")]
    weight: Annotated[Real, Parameter("N", 1e-6, 1e7, "m g, on this wheel")]
    slope: Annotated[Real, Parameter("rad", -1.2, 1.2, "alpha, uphill positive")] = 0.0
    slip_std: Annotated[Real, Parameter("1", 0.0, 1.0)] = 0.0
    weight_std: Annotated[Real, Parameter("N", 0.0, 1e7)] = 0.0
    slope_std: Annotated[Real, Parameter("rad", 0.0, 1.2)] = 0.0

    def __post_init__(self) -> None:
        check(self, "run: ")


@final
@dataclass(frozen=True, kw_only=True)
class ShearStrength:
    """Shear strength parameters of the soil, which must be known beforehand."""

    friction_angle: Annotated[Real, Parameter("rad", 0.0, 1.4, "phi")]
    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6, "c")] = 0.0

    def __post_init__(self) -> None:
        check(self, "strength: ")
