r"""Stress of granular ground on a thin plate that moves through it: resistive-force theory.

Signs. The plate is inclined at the *attack* angle beta from the horizontal, positive if its leading
end is raised, and moves at the *intrusion* angle gamma below the
horizontal: gamma = pi/2 is straight down. With alpha_x and alpha_z the stress per depth,

.. math:: \sigma_x = -\alpha_x z \;\text{(against the travel)}, \qquad \sigma_z = \alpha_z z \;
    \text{(upwards)}

The law describes a thin plate, both faces together, without distinguishing a leading face. A plate
being withdrawn is resisted by a quarter of the stress at intrusion, and a resting plate is
supported by the part that does not depend on the motion.

References: Li, Zhang and Goldman, Science 339, 2013; Comin and Saaj 2017, eqs. 4 to 6, table II.
The paper's eq. 5 prints cosines throughout; the terms of B and D are sines. Measured for dry,
loosely packed grains, slow motion (no inertia of the grains) and plates near the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from soilml.arrays import Array
from soilml.parameters import Parameter

#: Coefficients of the generic granular medium, scaled so that alpha_z(0, pi/2) = 1; by (k, l).
A = {(0, 0): 0.206, (1, 0): 0.169}
B = {(1, 1): 0.212, (0, 1): 0.358, (-1, 1): 0.055}
C = {(1, 1): -0.124, (0, 1): 0.253, (-1, 1): 0.007}
D = {(1, 0): 0.088}


def stress_gains(attack: Array, intrusion: Array) -> tuple[Array, Array]:
    r"""(alpha_x, alpha_z) of the generic medium at attack and intrusion angles, rad.

    .. math::
        \alpha_z = \sum_{k,l} [A_{kl} \cos(2k\beta + l\gamma) + B_{kl} \sin(2k\beta + l\gamma)]

    and alpha_x with C and D (Comin and Saaj 2017, eq. 5, with sines). A plate moving
    backwards, |gamma| > pi/2, is the mirror image: alpha_x changes its sign. Inputs broadcast.

    Examples
    --------
    >>> alpha_x, alpha_z = stress_gains(0.0, 0.5 * np.pi)  # a flat plate pushed straight down
    >>> round(float(alpha_z), 3)
    1.0
    """
    beta, gamma = np.broadcast_arrays(np.asarray(attack, float), np.asarray(intrusion, float))
    ahead = np.where(np.cos(gamma) < 0, -1.0, 1.0)
    gamma = np.arctan2(np.sin(gamma), np.abs(np.cos(gamma)))
    beta = ahead * beta

    def series(cosines: dict[tuple[int, int], float], sines: dict[tuple[int, int], float]) -> Array:
        even = sum(w * np.cos(2 * k * beta + m * gamma) for (k, m), w in cosines.items())
        odd = sum(w * np.sin(2 * k * beta + m * gamma) for (k, m), w in sines.items())
        return even + odd

    return ahead * series(C, D), series(A, B)


def resistance_terms(c2: Array, s2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    r"""Stress per depth on plates, forward and upward, for the generic medium, in six terms.

    .. math:: (\sigma_x, \sigma_z) / z = \sigma_{rest}(\beta) - R(\beta) \hat v

    Static part (x, z) and matrix R (xx, xz, zx, zz) at cos 2 beta and sin 2 beta, beta
    anticlockwise from the direction of travel x; v is the direction of motion, a unit vector with
    z upwards. The same law as `stress_gains`, linear in that vector once its angles are written
    out: no angle is wrapped, no mirror image is chosen, and the Jacobian is explicit.
    """
    return (
        -D[1, 0] * s2,
        A[0, 0] + A[1, 0] * c2,
        C[0, 1] + (C[1, 1] + C[-1, 1]) * c2,
        (C[1, 1] - C[-1, 1]) * s2,
        (B[-1, 1] - B[1, 1]) * s2,
        B[0, 1] + (B[1, 1] + B[-1, 1]) * c2,
    )


LUMPED_AT = 0.01  # Depth at which the paper states the normal stiffness sigma_1, m


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
