"""The shear modulus that each climb has on its own, and what an error of the speed does to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior
from soilml.systems.climbing.balance_likelihood import Balances
from soilml.systems.climbing.climb import Climb
from soilml.systems.climbing.rover import Rover

Floats = NDArray[np.float64]

#: Where k_x is looked for, m.
RANGE = Prior(1e-4, 0.2, log=True)
LOOKS = 2001


def modulus_of_each(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    cohesion: float,
    friction_angle: float,
    speed_error: float = 0.0,
) -> Floats:
    """k_x (m) at which each climb balances (climbs,); NaN where none from 0.1 to 200 mm does.

    `speed_error` is a share by which the speeds are taken to have been read: 0.015 too fast. The
    pull of a driving wheel falls as k_x rises, so that there is at most one. References: Nagatani
    et al., section 6.2, Figs. 8 and 9.
    """
    read = [climb.with_speed_error(speed_error) for climb in climbs]
    modulus = RANGE.at(np.linspace(0.0, 1.0, LOOKS))
    soils = np.stack([np.full(LOOKS, cohesion), np.full(LOOKS, friction_angle), modulus], axis=1)
    found = []
    for off in Balances.over(rover, read, RANGE).off(soils).T:
        last = np.flatnonzero((off[:-1] > 0.0) & (off[1:] <= 0.0))
        if len(last) == 0:
            found.append(np.nan)
            continue
        i = int(last[0])
        share = off[i] / (off[i] - off[i + 1])
        found.append(float(modulus[i] * (modulus[i + 1] / modulus[i]) ** share))
    return np.asarray(found)
