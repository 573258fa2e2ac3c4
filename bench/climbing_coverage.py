"""Coverage of the predicted intervals over simulated rovers whose soil is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.numerics.quantiles import QUANTILES
from soilml.quantities import SHEAR
from soilml.systems.climbing.ability import climbing_ability
from soilml.systems.climbing.climb import Rover
from soilml.systems.climbing.identify import identify_ground
from soilml.systems.climbing.simulated_rover import SimulatedRover, StressArc
from soilml.systems.climbing.stress_by_slip import StressBySlip

Floats = NDArray[np.float64]

#: Slip at which the pull is compared; slope (rad) that a random rover must at least climb.
SLIP, MIN_STEEPEST = 0.4, 0.2


@dataclass(frozen=True)
class PredictionCoverage:
    """Error, predicted std, and fraction of samples below the truth, for each rover (n,)."""

    error: Floats
    std: Floats
    below: Floats

    @property
    def inside(self) -> float:
        """Fraction of rovers whose true value lies in the 90 % interval."""
        return float(np.mean((self.below > QUANTILES[0]) & (self.below < QUANTILES[-1])))

    @property
    def score(self) -> float:
        """Root mean square of error over std: 1 if the std is calibrated."""
        return float(np.sqrt(np.mean((self.error / self.std) ** 2)))


def simulate_coverage(
    seeds: Sequence[int],
    slopes: Sequence[float],
    *,
    fixed: Sequence[str] = ("cohesion", "friction_angle"),
    known_loads: bool = True,
) -> Mapping[str, PredictionCoverage]:
    """Simulate a random rover for each seed on `slopes` (rad), predict, and compare with its truth.

    Keys: the parameters that are not fixed, `pull` (N, at slip 0.4 on level ground) and `steepest`
    (rad).
    """
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        true = random_rover(rng)
        climbs = true.simulate_climbs(rng, slopes)
        front, rear = true.simulate_artificial_slip(rng)
        known = dict(zip(SHEAR, true.shear, strict=True))
        ground = identify_ground(
            true.rover if known_loads else replace(true.rover, front_share=None, height_ratio=None),
            climbs,
            fixed={name: known[name] for name in fixed},
            noise=true.noise,
            seed=seed,
        )
        ability = climbing_ability(
            ground,
            StressBySlip.fit([*(c.front for c in climbs), *front]),
            StressBySlip.fit([*(c.rear for c in climbs), *rear]),
            seed=seed,
        )
        slips, pulls, steeps = true.curve
        i = int(np.argmin(np.abs(ability.slip - SLIP)))
        compared = {
            name: (ground.samples[:, SHEAR.index(name)], known[name]) for name in ground.fit.names
        }
        compared["pull"] = ability.pull[:, i], float(np.interp(ability.slip[i], slips, pulls))
        compared["steepest"] = ability.steepest, float(steeps[slips <= ability.slip[-1]].max())
        for name, (samples, truth) in compared.items():
            below = float(np.mean(samples < truth))
            row = float(samples.mean() - truth), float(samples.std()), below
            rows.setdefault(name, []).append(row)
    return {name: PredictionCoverage(*np.asarray(values).T) for name, values in rows.items()}


def random_rover(rng: np.random.Generator) -> SimulatedRover:
    """A rover with random soil, stresses and centre of mass that climbs 11 degrees or more."""

    def arc(entry: float) -> StressArc:
        return StressArc(
            entry=entry + rng.uniform(-0.02, 0.02),
            shift=rng.uniform(0.20, 0.34),
            shift_exponent=rng.uniform(1.2, 2.2),
            width=rng.uniform(0.48, 0.56),
            rear_exponent=rng.uniform(1.1, 1.7),
            front_exponent=rng.uniform(0.8, 1.1),
        )

    while True:
        rover = Rover(
            mass=12.0,
            radius=0.055,
            width=0.064,
            front_share=rng.uniform(0.42, 0.58),
            height_ratio=rng.uniform(0.2, 0.5),
        )
        shear = 0.0, float(rng.uniform(0.6, 0.73)), float(rng.uniform(0.005, 0.010))
        candidate = SimulatedRover(rover=rover, shear=shear, arcs=(arc(0.33), arc(0.31)))
        if candidate.steepest > MIN_STEEPEST:
            return candidate
