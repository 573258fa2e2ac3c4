"""Ground under a wheel-leg whose normal stress increases linearly with depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from soilml.parameters import Parameter

#: Depth at which the paper states the normal stiffness sigma_1, m.
LUMPED_AT = 0.01


@final
@dataclass(frozen=True, kw_only=True)
class LinearGround:
    r"""Normal stress under a flat plate pushed straight down, in SI.

    .. math:: \sigma(z) = \sigma_0 + \alpha_z z, \qquad \sigma_1 = \sigma_0 + \alpha_z \cdot 1 cm

    References: Comin and Saaj 2017, eq. 3 and table I. Resistive-force theory, eq. 4, has no
    offset: its stress is proportional to depth.
    """

    stiffness: Annotated[float, Parameter("N/m^3", 1.0, 1e9, "alpha_z(0, pi/2)")]
    offset: Annotated[float, Parameter("Pa", 0.0, 1e7, "sigma_0, stress at the surface")] = 0.0
    friction_angle: Annotated[float, Parameter("rad", 0.0, 1.4, "phi; not used in walking")] = 0.6

    @property
    def normal_stiffness(self) -> float:
        """sigma_1, the normal stress one centimetre deep, Pa."""
        return self.offset + self.stiffness * LUMPED_AT

    @property
    def invalid_reason(self) -> str:
        """Why the ground is invalid; empty if it is valid."""
        if not (np.isfinite(self.stiffness) and self.stiffness > 0.0):
            return f"a stiffness of {self.stiffness:g} N/m^3; it must be positive"
        if not (np.isfinite(self.offset) and self.offset >= 0.0):
            return f"an offset of {self.offset:g} Pa; it must be 0 or more"
        return ""


#: The four soils of the tests, prepared by raking (Comin and Saaj 2017, table I).
GROUNDS: dict[str, LinearGround] = {
    "SSC-1": LinearGround(stiffness=0.29e6, offset=8400.0, friction_angle=0.7381),
    "SSC-2": LinearGround(stiffness=1.05e6, offset=13100.0, friction_angle=0.746477),
    "SSC-3": LinearGround(stiffness=0.70e6, offset=2900.0, friction_angle=0.507891),
    "ES-3": LinearGround(stiffness=1.70e6, offset=5000.0, friction_angle=0.625351),
}
