"""The numbers that Nagatani et al. print on climbing ability, computed for a simulated rover.

The paper prints no measured force, stress or shear modulus as a number. Its claim, that the pull on
steep slopes follows from slopes of 0 and 4 degrees, is tested with a rover on a known soil
(`soilml.systems.rim_stress.SimulatedRover`) under the same conditions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from soilml.errors import FitError
from soilml.quantities import SHEAR
from soilml.systems.rim_stress import (
    Climb,
    ClimbingAbility,
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
)
from soilml.systems.rim_stress.climbs import modulus_per_climb
from soilml.systems.rim_stress.simulation import SLOPES

CAMPAIGNS = 9  # Simulated campaigns, of which one is beyond the tolerance
GENTLE, REPEATS = SLOPES[:2], 4  # Slopes from which the paper predicts, and repetitions of each


@cache
def _climbs(seed: int = 0) -> tuple[Climb, ...]:
    return tuple(SimulatedRover().simulate_climbs(np.random.default_rng(seed), SLOPES, REPEATS))


@cache
def _ability() -> ClimbingAbility:
    """Prediction from slopes of 0 and 4 degrees and artificial slip, with known c and phi."""
    true = SimulatedRover()
    front, rear = true.simulate_artificial_slip(np.random.default_rng(1))
    known = dict(zip(SHEAR[:2], true.shear[:2], strict=True))
    climbs = _climbs()[: len(GENTLE) * REPEATS]
    ground = identify_ground(true.rover, climbs, fixed=known)
    front += [climb.front for climb in climbs]
    rear += [climb.rear for climb in climbs]
    return climbing_ability(ground, StressBySlip.fit(front), StressBySlip.fit(rear))


def _predicted_slope(climbed: float) -> float:
    """Slope (deg) predicted at the slip at which the rover climbs the slope `climbed` (deg)."""
    ability, slip = _ability(), SimulatedRover().slip_at(float(np.deg2rad(climbed)))
    return float(np.rad2deg(np.interp(slip, ability.slip, np.median(ability.slope, axis=0))))


def _required_slopes() -> float:
    """The smallest number of slopes from which c, phi and k_x can be identified."""
    true = SimulatedRover()
    for count in range(1, len(SLOPES) + 1):
        try:
            identify_ground(true.rover, _climbs()[: count * REPEATS])
        except FitError:
            continue
        return float(count)
    return float("nan")


def _modulus_ratio() -> float:
    """Largest over smallest k_x, each the mean of the runs of a slope; median of `CAMPAIGNS`."""
    cohesion, friction, _ = SimulatedRover().shear
    ratios = []
    for seed in range(CAMPAIGNS):
        each = modulus_per_climb(
            SimulatedRover().rover, _climbs(seed), cohesion=cohesion, friction_angle=friction
        )
        mean = each.reshape(len(SLOPES), REPEATS).mean(axis=1)
        ratios.append(float(mean.max() / mean.min()))
    return float(np.median(ratios))


#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {
    **{f"slope_{slope}": partial(_predicted_slope, slope) for slope in (0, 4, 8, 10, 12)},
    "conditions": _required_slopes,
    "modulus_constant": _modulus_ratio,
}
