"""The parameters of a soil."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

from soilml.arrays import Real
from soilml.parameters import Parameter


@final
@dataclass(frozen=True, kw_only=True)
class Soil:
    r"""Shear strength, pressure-sinkage curve and angle of maximum stress of a soil, in SI units.

    .. math::
        \tau_{max} = c + \sigma \tan\varphi, \qquad
        \sigma = (k_c / b + k_\varphi) z^n, \qquad
        \theta_m = (a_0 + a_1 s) \theta_1

    References: Mohr-Coulomb; Bekker, Introduction to Terrain-Vehicle Systems, 1969; Wong and
    Reece, J. Terramechanics 4(1), 1967, eq. for the angle of maximum stress.

    Any field may be an array; a model broadcasts them against each other and the operating point.
    """

    cohesion: Annotated[Real, Parameter("Pa", 0.0, 1e6, "c")]
    friction_angle: Annotated[Real, Parameter("rad", 0.0, 1.4, "phi, internal friction angle")]
    shear_modulus: Annotated[Real, Parameter("m", 1e-5, 1.0, "K, shear deformation modulus")]
    kc: Annotated[Real, Parameter("N/m^(n+1)", -1e8, 1e9, "cohesive modulus of sinkage")]
    kphi: Annotated[Real, Parameter("N/m^(n+2)", -1e9, 1e10, "frictional modulus of sinkage")]
    n: Annotated[Real, Parameter("1", 0.05, 3.0, "exponent of sinkage")]
    a0: Annotated[Real, Parameter("1", 0.0, 1.0, "theta_m / theta_1 at no slip")] = 0.4
    a1: Annotated[Real, Parameter("1", -1.0, 1.0, "growth of theta_m / theta_1 with slip")] = 0.15
    unit_weight: Annotated[Real, Parameter("N/m^3", 0.0, 5e4, "weight per volume")] = 15000.0
