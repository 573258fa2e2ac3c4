"""What Nagatani et al. print of climbing ability, computed on a simulated rover.

The paper prints no measured force, stress or shear modulus as a number: what it claims, that the
pull on steep slopes follows from slopes of 0 and 4 degrees, is tried on a rover whose ground is
known (`soilml.systems.climbing.SimulatedRover`), driven as the paper's was.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from soilml.errors import FitError
from soilml.quantities import SHEAR
from soilml.systems.climbing import (
    Ability,
    Climb,
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
    modulus_of_each,
)
from soilml.systems.climbing.simulated_rover import SLOPES

#: Slopes on which the paper's prediction rests, and repetitions of each.
GENTLE, REPEATS = SLOPES[:2], 4


@cache
def _climbs() -> tuple[Climb, ...]:
    return tuple(SimulatedRover().climbs(np.random.default_rng(0), SLOPES, REPEATS))


@cache
def _ability() -> Ability:
    """Predicted from slopes of 0 and 4 degrees and artificial slip, c and phi given."""
    true = SimulatedRover()
    front, rear = true.artificial(np.random.default_rng(1))
    known = dict(zip(SHEAR[:2], true.shear[:2], strict=True))
    climbs = _climbs()[: len(GENTLE) * REPEATS]
    ground = identify_ground(true.rover, climbs, given=known)
    front += [climb.front for climb in climbs]
    rear += [climb.rear for climb in climbs]
    return climbing_ability(ground, StressBySlip.of(front), StressBySlip.of(rear))


def _slope(driven: float) -> float:
    """Slope (deg) predicted at the slip at which the rover climbs the slope `driven` (deg)."""
    ability, slip = _ability(), SimulatedRover().slip(float(np.deg2rad(driven)))
    return float(np.rad2deg(np.interp(slip, ability.slip, np.median(ability.slope, axis=0))))


def _conditions() -> float:
    """The least number of slopes from which c, phi and k_x are found."""
    true = SimulatedRover()
    for count in range(1, len(SLOPES) + 1):
        try:
            identify_ground(true.rover, _climbs()[: count * REPEATS])
        except FitError:
            continue
        return float(count)
    return float("nan")


def _constancy() -> float:
    """Largest over smallest k_x, each the mean of the runs of one slope."""
    cohesion, friction, _ = SimulatedRover().shear
    each = modulus_of_each(
        SimulatedRover().rover, _climbs(), cohesion=cohesion, friction_angle=friction
    )
    mean = each.reshape(len(SLOPES), REPEATS).mean(axis=1)
    return float(mean.max() / mean.min())


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    **{f"slope_{slope}": partial(_slope, slope) for slope in (0, 4, 8, 10, 12)},
    "conditions": _conditions,
    "modulus_constant": _constancy,
}
