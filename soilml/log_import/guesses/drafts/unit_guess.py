"""Units that a log does not state, by the size of the values."""

from __future__ import annotations

import math

from soilml.log_import.guesses.columns.candidates import Candidate
from soilml.log_import.guesses.columns.column_words import words_of

#: Radius of the wheels of rovers and rigs, m: the usual one, and its range.
_USUAL_RADIUS, _RADII = 0.12, (0.02, 0.6)
#: Masses that a scale shows, as forces; any other is taken for kg.
_AS_FORCE = {"g": "gf", "gram": "gf", "grams": "gf", "lb": "lbf", "pound": "lbf", "pounds": "lbf"}
#: Words that say that a column counts the pulses of an encoder.
_COUNTS = {"count", "counts", "tick", "ticks", "enc", "encoder", "qc", "pulses"}


def guess_unit(role: str, column: Candidate, moving: float) -> tuple[str, str]:
    """The unit of a column, and why: "" where the log states it.

    `moving` is the 90th percentile of the values without sign.
    """
    if column.unit and column.kind is not None:
        if column.kind == "kg":
            force = _AS_FORCE.get(column.unit.lower(), "kgf")
            return force, f"the log says {column.unit}; as a force that is {force}"
        return column.unit, ""
    words = words_of(column.name)
    if role in ("wheel_angle", "wheel_speed") and _COUNTS & {*words}:
        return "count" if role == "wheel_angle" else "count/s", "by its name"
    if role == "wheel_angle":
        if column.about.wraps_at:
            if abs(column.about.wraps_at - 2.0 * math.pi) < 0.01:
                return "rad", "it starts again at 2 pi"
            if column.about.wraps_at == 360.0:
                return "deg", "it starts again at 360"
            return "count", f"it starts again at {column.about.wraps_at:g}"
        return ("deg", "its values are large") if moving > 60.0 else ("rad", "its values are small")
    large = {
        "ground_speed": ((8.0, "mm/s"), (3.0, "cm/s"), (0.0, "m/s")),
        "rim_speed": ((8.0, "mm/s"), (3.0, "cm/s"), (0.0, "m/s")),
        "position": ((25.0, "mm"), (0.0, "m")),
        "sinkage": ((1.0, "mm"), (0.0, "m")),
        "torque": ((300.0, "mN m"), (0.0, "N m")),
        "motor_current": ((60.0, "mA"), (0.0, "A")),
        "slope": ((1.2, "deg"), (0.0, "rad")),
        "slip": ((1.2, "%"), (0.0, "1")),
        "load": ((0.0, "N"),),
        "drawbar_pull": ((0.0, "N"),),
        "wheel_speed": ((0.0, "rad/s"),),
    }[role]
    unit = next(unit for least, unit in large if moving >= least)
    if "rpm" in words:
        unit = "rpm"
    why = "not stated; by the size of the values" if len(large) > 1 else "not stated"
    return unit, why


def guess_rotation_unit(rotation: float, travel: float, radius: float) -> tuple[str, str]:
    """Unit of a rotation rate of this size beside a travel speed (m/s), and why.

    Each unit implies a radius at which nothing slips. That of the map, or a usual one, decides.
    """
    if not (rotation > 0.0 and travel > 0.0):
        return "rad/s", "not stated"
    options = {"rad/s": 1.0, "rpm": math.pi / 30.0, "deg/s": math.pi / 180.0}
    wanted = radius if radius > 0.0 else _USUAL_RADIUS
    implied = {unit: travel / (rotation * factor) for unit, factor in options.items()}
    unit = min(implied, key=lambda u: abs(math.log(implied[u] / (0.8 * wanted))))
    if not _RADII[0] < implied[unit] < _RADII[1]:
        return "rad/s", "not stated; no unit fits the travel, so that a gearbox may lie between"
    return unit, f"not stated; it would fit a radius of {implied[unit]:.2g} m or more"
