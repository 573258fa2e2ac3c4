"""From gentle climbs to the soil and to slopes not yet climbed."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.numerics.quantiles import quantile_band
from soilml.quantities import SHEAR
from soilml.systems.rim_stress import (
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
)
from soilml.systems.rim_stress.ability import compare_stress
from soilml.systems.rim_stress.simulation import StressArc

pytestmark = pytest.mark.slow

SAND = {"cohesion": 0.0, "friction_angle": float(np.deg2rad(38.0))}
TRUE = SimulatedRover()
SLOPES = np.deg2rad([0.0, 4.0]).tolist()


@pytest.fixture(scope="module")
def climbs():
    return TRUE.simulate_climbs(np.random.default_rng(3), SLOPES)


@pytest.fixture(scope="module")
def level():
    return TRUE.simulate_artificial_slip(np.random.default_rng(2))


def test_steep_slopes_are_predicted_from_gentle_ones(climbs, level):
    ground = identify_ground(TRUE.rover, climbs, fixed=SAND)
    error = ground.fit["shear_modulus"] - TRUE.shear[2]
    assert abs(error) < 3.0 * ground.fit.std[0] < 0.003
    ability = climbing_ability(ground, *(StressBySlip.fit(wheels) for wheels in level))
    slope = quantile_band(ability.slope)
    for driven in np.deg2rad([8.0, 10.0, 12.0]):
        at = TRUE.slip_at(driven)
        low, high = (np.interp(at, ability.slip, v) for v in (slope.lower, slope.upper))
        assert low - 0.005 < driven < high + 0.005
    best = quantile_band(ability.steepest)
    assert best.lower - 0.005 < TRUE.steepest < best.upper + 0.005
    assert best.upper - best.lower < 0.06


def test_stress_on_slopes_that_differs_from_that_at_artificial_slip_is_told(climbs, level):
    steep = TRUE.simulate_climbs(np.random.default_rng(5), np.deg2rad([8.0, 12.0]).tolist())
    front = [climb.front for climb in steep]
    same = compare_stress(front, level[0])
    assert same.equal and same.runs == len(front)
    moved = replace(TRUE.arcs[0], entry=TRUE.arcs[0].entry + 0.05)
    other = replace(TRUE, arcs=(moved, TRUE.arcs[1]))
    shifted = other.simulate_climbs(np.random.default_rng(5), np.deg2rad([8.0, 12.0]).tolist())
    found = compare_stress([climb.front for climb in shifted], level[0])
    assert not found.equal
    assert found.difference == pytest.approx(0.05, abs=0.015)


def random_rover(rng):
    """A rover with random soil, stresses and centre of mass that climbs 11 degrees or more."""
    while True:
        arcs = tuple(
            StressArc(
                entry=entry + rng.uniform(-0.02, 0.02), shift=rng.uniform(0.2, 0.34),
                shift_exponent=rng.uniform(1.2, 2.2), width=rng.uniform(0.48, 0.56),
                rear_exponent=rng.uniform(1.1, 1.7), front_exponent=rng.uniform(0.8, 1.1),
            )
            for entry in (0.33, 0.31)
        )  # fmt: skip
        share, height = rng.uniform(0.42, 0.58), rng.uniform(0.2, 0.5)
        rover = replace(TRUE.rover, front_share=share, height_ratio=height)
        shear = 0.0, rng.uniform(0.6, 0.73), rng.uniform(0.005, 0.010)
        found = SimulatedRover(rover=rover, shear=shear, arcs=arcs)
        if found.steepest > 0.2:
            return found


def test_intervals_cover_the_truth_of_random_rovers():
    """Six rovers: three or fewer inside bands of nine tenths would come once in sixty."""
    found = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        true = random_rover(rng)
        climbs = true.simulate_climbs(rng, SLOPES)
        front, rear = true.simulate_artificial_slip(rng)
        known = dict(zip(SHEAR[:2], true.shear, strict=False))
        ground = identify_ground(true.rover, climbs, fixed=known, seed=seed)
        front, rear = front + [c.front for c in climbs], rear + [c.rear for c in climbs]
        ability = climbing_ability(
            ground, StressBySlip.fit(front), StressBySlip.fit(rear), seed=seed
        )
        slips, pulls, steeps = true.curve
        i = int(np.argmin(np.abs(ability.slip - 0.4)))
        compared = (
            (ground.samples[:, 2], true.shear[2]),
            (ability.pull[:, i], np.interp(ability.slip[i], slips, pulls)),
            (ability.steepest, steeps[slips <= ability.slip[-1]].max()),
        )
        found.append([((v.mean() - x) / v.std(), np.mean(v < x)) for v, x in compared])
    error, below = np.moveaxis(np.asarray(found), -1, 0)
    assert (((below > 0.05) & (below < 0.95)).mean(axis=0) > 0.6).all()
    score = np.sqrt((error**2).mean(axis=0))
    assert ((score > 0.3) & (score < 1.9)).all()
