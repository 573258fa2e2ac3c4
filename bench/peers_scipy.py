"""The rigid wheel as one first writes it: adaptive quadrature inside a bracketing root search."""

from __future__ import annotations

import math
from collections.abc import Mapping

from scipy.integrate import quad
from scipy.optimize import brentq

LOWEST, HIGHEST = 1e-3, 0.5 * math.pi


def torque(row: Mapping[str, float], tolerance: float) -> float:
    """Torque (N m) of one driving wheel, with this relative tolerance of integrals and root.

    See `soilml.physics.gears.wheel` for the equations; `row` has the numbers of
    `plain_numpy.torque`.
    """
    r, b, slip, n = row["radius"], row["width"], row["slip"], row["n"]
    modulus, tangent = row["kc"] / b + row["kphi"], math.tan(row["friction_angle"])
    share = row["a0"] + row["a1"] * slip

    def stresses(angle: float, entry: float) -> tuple[float, float]:
        peak = share * entry
        mirrored = angle if angle >= peak else entry - angle / peak * (entry - peak)
        depth = r * (math.cos(mirrored) - math.cos(entry))
        normal = modulus * max(depth, 0.0) ** n
        moved = r * (entry - angle - (1.0 - slip) * (math.sin(entry) - math.sin(angle)))
        strength = row["cohesion"] + normal * tangent
        return normal, strength * (1.0 - math.exp(-moved / row["shear_modulus"]))

    def upward(angle: float, entry: float) -> float:
        normal, shear = stresses(angle, entry)
        return normal * math.cos(angle) + shear * math.sin(angle)

    def load(entry: float) -> float:
        return r * b * _integral(upward, entry, share * entry, tolerance)

    entry = brentq(lambda angle: load(angle) - row["load"], LOWEST, HIGHEST, rtol=tolerance)
    integral = _integral(lambda at, top: stresses(at, top)[1], entry, share * entry, tolerance)
    return r * r * b * integral


def _integral(f, entry: float, peak: float, tolerance: float) -> float:
    """Over both parts of the contact, whose border is a kink."""
    parts = ((0.0, peak), (peak, entry))
    return sum(quad(f, *ends, (entry,), epsrel=tolerance, epsabs=0.0)[0] for ends in parts)
