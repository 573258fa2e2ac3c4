"""The rigid wheel as one first vectorises it: trapezoid rule and bisection, all rows at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Points along the contact, and halvings of the interval of entry angles (rad).
POINTS, HALVINGS = 201, 40
LOWEST, HIGHEST = 1e-3, 0.5 * np.pi


def torque(rows: Mapping[str, Floats | float]) -> Floats:
    """Torque (N m) of driving wheels, (batch,); see `soilml.physics.gears.wheel` for the equations.

    `rows` has radius, width, cohesion, friction_angle, shear_modulus, n, kc, kphi, a0, a1, slip and
    load, arrays (batch,) or numbers.
    """
    low = np.full(np.shape(rows["load"]), LOWEST)
    high = np.full(np.shape(rows["load"]), HIGHEST)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        light = _integrals(rows, middle)[0] < rows["load"]
        low, high = np.where(light, middle, low), np.where(light, high, middle)
    return _integrals(rows, 0.5 * (low + high))[1]


def _integrals(rows: Mapping[str, Any], entry: Floats) -> tuple[Floats, Floats]:
    """Load (N) and torque (N m) at this entry angle (rad)."""
    r, b = rows["radius"], rows["width"]
    angle = np.linspace(0.0, 1.0, POINTS)[:, None] * entry
    peak = (rows["a0"] + rows["a1"] * rows["slip"]) * entry
    mirrored = entry - angle / peak * (entry - peak)
    depth = r * (np.cos(np.where(angle < peak, mirrored, angle)) - np.cos(entry))
    normal = (rows["kc"] / b + rows["kphi"]) * np.maximum(depth, 0.0) ** rows["n"]
    moved = r * (entry - angle - (1.0 - rows["slip"]) * (np.sin(entry) - np.sin(angle)))
    strength = rows["cohesion"] + normal * np.tan(rows["friction_angle"])
    shear = strength * (1.0 - np.exp(-moved / rows["shear_modulus"]))
    load = r * b * np.trapezoid(normal * np.cos(angle) + shear * np.sin(angle), angle, axis=0)
    return load, r * r * b * np.trapezoid(shear, angle, axis=0)
