"""Soils whose laws differ from those of the analyst's wheel, and soils that change with time.

The names of the laws are those by which a field knows them; the forms are from the literature, and
most differ from the forms that an analyst may have of the same family.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.blind_sets.reference_wheel import ContactPoints, Floats, WheelState, mechanism

#: Depth, as a share of that of a firm base, beyond which the soil gives way no further.
FIRM = 0.995
#: Normal stress (Pa) at which a curved envelope has the friction angle of the straight one, and the
#: smallest at which its law holds.
ENVELOPE_STRESS, SMALLEST_STRESS = 1e4, 100.0


def _mobilised(points: ContactPoints, share: Floats) -> Floats:
    """Shear stress of which this share of the strength is mobilised, in the sense of shearing."""
    return np.copysign(points.strength * share, points.shear_displacement)


@mechanism("L", "hyperbolic-shear", "share", 0.5, "1", "shear")
def _hyperbolic_shear(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Kondner 1963: j / (K + j) in place of an exponential, blended in by its share."""
    j = np.abs(points.shear_displacement)
    hyperbola = _mobilised(points, j / (rows.shear_modulus + j))
    return np.asarray((1.0 - share) * points.shear + share * hyperbola)


@mechanism("L", "shear-softening", "share", 0.3, "1", "shear", form="peak-and-decay")
def _peak_and_decay(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Wong and Preston-Thomas 1983: (j / K_w) e^(1 - j / K_w), K_w = 2 K, blended in by a share."""
    x = np.abs(points.shear_displacement) / (2.0 * rows.shear_modulus)
    return np.asarray(
        (1.0 - share) * points.shear + share * _mobilised(points, x * np.exp(1.0 - x))
    )


@mechanism("L", "elliptic-pressure", "share", 0.5, "1", "shape")
def _elliptic(normal: Floats, way: Floats, peak: Floats, rows: WheelState, share: float) -> Floats:
    """Hertz: the root of 1 - xi^2 on both sides of the largest stress, xi = 1 at the ends."""
    xi = 1.0 - way
    return np.asarray((1.0 - share) * normal + share * peak * np.sqrt(1.0 - xi**2))


@mechanism("L", "parabolic-pressure", "share", 0.5, "1", "shape")
def _parabolic(normal: Floats, way: Floats, peak: Floats, rows: WheelState, share: float) -> Floats:
    """A parabola 1 - xi^2 on both sides of the largest stress."""
    xi = 1.0 - way
    return np.asarray((1.0 - share) * normal + share * peak * (1.0 - xi**2))


@mechanism("L", "saturating-pressure", "softness", 2e-5, "1/Pa", "pressure", form="tanh")
def _saturating_pressure(
    normal: Floats, depth: Floats, rows: WheelState, softness: float
) -> Floats:
    """Kacigin and Guskov 1968: a hyperbolic tangent, with the limit 1 / softness."""
    if softness == 0.0:
        return normal
    return np.asarray(np.tanh(softness * normal) / softness)


@mechanism("L", "firm-base", "nearness", 25.0, "1/m", "pressure", form="asymptote")
def _firm_base(normal: Floats, depth: Floats, rows: WheelState, nearness: float) -> Floats:
    """Wong's layered terrain: the pressure grows without limit towards the depth 1 / nearness."""
    share = np.minimum(nearness * depth, FIRM)
    return np.asarray(normal / (1.0 - share**2))


@mechanism("L", "curved-envelope", "loss", 0.08, "rad", "shear", form="logarithmic")
def _curved_envelope(points: ContactPoints, rows: WheelState, loss: float) -> Floats:
    """Bolton 1986: the friction angle falls by `loss` (rad) with each tenfold normal stress."""
    decades = np.log10(np.maximum(points.normal, SMALLEST_STRESS) / ENVELOPE_STRESS)
    strength = rows.cohesion + points.normal * np.tan(rows.friction_angle - loss * decades)
    return np.asarray(points.shear * strength / points.strength)


@mechanism("T", "trend", "change", 0.04, "rad", "soil", form="friction")
def _friction_trend(rows: WheelState, change: float) -> WheelState:
    """The friction angle grows by `change` (rad) from the first run to the last."""
    return replace(rows, friction_angle=rows.friction_angle + change * rows.elapsed)


@mechanism("T", "trend", "change", 0.3, "1", "soil", form="bearing")
def _bearing_trend(rows: WheelState, change: float) -> WheelState:
    """The logarithm of the modulus falls by `change` from the first run to the last."""
    weaker = np.exp(-change * rows.elapsed)
    return replace(rows, kc=rows.kc * weaker, kphi=rows.kphi * weaker)


@mechanism("T", "trend", "loss", 0.4, "1", "soil", form="drying")
def _drying(rows: WheelState, loss: float) -> WheelState:
    """A soil loses the share `loss` of its cohesion, and half that share of its modulus."""
    bearing = 1.0 - 0.5 * loss * rows.elapsed
    return replace(
        rows,
        cohesion=rows.cohesion * (1.0 - loss * rows.elapsed),
        kc=rows.kc * bearing,
        kphi=rows.kphi * bearing,
    )


@mechanism("T", "trend", "size", 1.0, "1", "soil", form="both")
def _both_trends(rows: WheelState, size: float) -> WheelState:
    """Friction angle and modulus drift together: 2 degrees and a quarter at a size of one."""
    return _bearing_trend(_friction_trend(rows, 0.035 * size), 0.25 * size)
