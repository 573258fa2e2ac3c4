"""The shear modulus of each climb alone, and its sensitivity to an error of the speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.prior import Prior
from soilml.systems.climbing.climb import Climb, Rover
from soilml.systems.climbing.climb_balances import ForceBalances

Floats = NDArray[np.float64]

#: Range in which k_x is searched, m, and points of the search grid, evenly spaced in ln k_x.
RANGE = Prior(1e-4, 0.2, log=True)
GRID_SIZE = 2001


def modulus_per_climb(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    cohesion: float,
    friction_angle: float,
    speed_error: float = 0.0,
) -> Floats:
    """k_x (m) at which the forces of each climb balance (climbs,).

    NaN if none from 0.1 to 200 mm does. With `speed_error` the climbs are evaluated as if the
    speeds had been measured too high by this fraction. The pull of a driving wheel decreases with
    k_x, so that there is at most one solution. References: Nagatani et al., section 6.2, Figs. 8
    and 9.
    """
    assumed = [climb.with_speed_error(speed_error) for climb in climbs]
    modulus = RANGE.at(np.linspace(0.0, 1.0, GRID_SIZE))
    soils = np.stack(
        [np.full(GRID_SIZE, cohesion), np.full(GRID_SIZE, friction_angle), modulus], axis=1
    )
    moduli = []
    for residual in ForceBalances.tabulate(rover, assumed, RANGE).residuals(soils).T:
        crossings = np.flatnonzero((residual[:-1] > 0.0) & (residual[1:] <= 0.0))
        if len(crossings) == 0:
            moduli.append(np.nan)
            continue
        i = int(crossings[0])
        share = residual[i] / (residual[i] - residual[i + 1])  # linear in ln k_x
        moduli.append(float(modulus[i] * (modulus[i + 1] / modulus[i]) ** share))
    return np.asarray(moduli)
