"""Whether bands hold the truth as often as they say, over rovers whose ground is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import SHEAR
from soilml.systems.climbing.ability import BAND, climbing_ability
from soilml.systems.climbing.identify import identify_ground
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.simulated_rover import Arc, SimulatedRover
from soilml.systems.climbing.stress_by_slip import StressBySlip

Floats = NDArray[np.float64]

#: Slip at which the pull is looked at; the steepest slope that a drawn rover must at least climb.
SLIP, CLIMBS = 0.4, 0.2


@dataclass(frozen=True)
class Covered:
    """Rovers (n,): how far off, the std that was claimed, the share of draws below the truth."""

    error: Floats
    std: Floats
    below: Floats

    @property
    def inside(self) -> float:
        """Share of rovers whose truth lies in the band of nine tenths."""
        return float(np.mean((self.below > BAND[0]) & (self.below < BAND[1])))

    @property
    def score(self) -> float:
        """Root mean square of error over std: 1 where the std is what it says."""
        return float(np.sqrt(np.mean((self.error / self.std) ** 2)))


def coverage(
    seeds: Sequence[int],
    slopes: Sequence[float],
    *,
    given: Sequence[str] = ("cohesion", "friction_angle"),
    knows_loads: bool = True,
) -> Mapping[str, Covered]:
    """Drive a rover drawn by each seed on `slopes` (rad), predict, and compare with its truth.

    Keys: the parameters not given, `pull` (N, at slip 0.4 on the flat) and `steepest` (rad).
    """
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        true = drawn_rover(rng)
        climbs, (front, rear) = true.climbs(rng, slopes), true.artificial(rng)
        known = dict(zip(SHEAR, true.shear, strict=True))
        ground = identify_ground(
            true.rover if knows_loads else replace(true.rover, front_share=None, height_ratio=None),
            climbs,
            given={name: known[name] for name in given},
            noise=true.noise,
            seed=seed,
        )
        ability = climbing_ability(
            ground,
            StressBySlip.of([*(c.front for c in climbs), *front]),
            StressBySlip.of([*(c.rear for c in climbs), *rear]),
            seed=seed,
        )
        slips, pulls, steeps = true.curve
        i = int(np.argmin(np.abs(ability.slip - SLIP)))
        looked = {
            name: (ground.draws[:, SHEAR.index(name)], known[name]) for name in ground.fit.names
        }
        looked["pull"] = ability.pull[:, i], float(np.interp(ability.slip[i], slips, pulls))
        looked["steepest"] = ability.steepest, float(steeps[slips <= ability.slip[-1]].max())
        for name, (draws, truth) in looked.items():
            row = float(draws.mean() - truth), float(draws.std()), float(np.mean(draws < truth))
            rows.setdefault(name, []).append(row)
    return {name: Covered(*np.asarray(values).T) for name, values in rows.items()}


def drawn_rover(rng: np.random.Generator) -> SimulatedRover:
    """A rover whose soil, stresses and centre of mass are drawn; it climbs 11 degrees or more."""

    def arc(entry: float) -> Arc:
        return Arc(
            entry=entry + rng.uniform(-0.02, 0.02),
            forward=rng.uniform(0.20, 0.34),
            bend=rng.uniform(1.2, 2.2),
            width=rng.uniform(0.48, 0.56),
            behind=rng.uniform(1.1, 1.7),
            ahead=rng.uniform(0.8, 1.1),
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
        found = SimulatedRover(rover=rover, shear=shear, arcs=(arc(0.33), arc(0.31)))
        if found.steepest > CLIMBS:
            return found
