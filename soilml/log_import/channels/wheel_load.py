"""Load of a wheel from the mass of its vehicle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from soilml.log_import.mapping.log_map import Vehicle

#: Value of a constant of the map by name, such as "vehicle.mass".
Constants = Callable[[str], float]


def vehicle_load(vehicle: Vehicle, axle: str, slope: Any, constant: Constants) -> Any:
    r"""Load (...) of one wheel at slopes (...), rad, positive uphill, N.

    With two axles at a distance L, and the centre of mass d behind the front axle and h above the
    ground, the front axle carries

    .. math:: m g ((L - d) \cos\alpha - h \sin\alpha) / L

    and the rear axle the rest of :math:`m g \cos\alpha`, half on each side where there are four
    wheels. Without `wheelbase` or without axles, all wheels carry the same. Static: pull and
    acceleration shift no load.
    """
    normal = constant("vehicle.mass") * vehicle.gravity * np.cos(slope)
    length = constant("vehicle.wheelbase")
    if axle not in ("front", "rear") or not length > 0.0:
        return normal / vehicle.wheels
    weight = constant("vehicle.mass") * vehicle.gravity
    behind, height = constant("vehicle.behind_front"), constant("vehicle.height")
    front = weight * ((length - behind) * np.cos(slope) - height * np.sin(slope)) / length
    return (front if axle == "front" else normal - front) / max(1.0, vehicle.wheels / 2.0)
