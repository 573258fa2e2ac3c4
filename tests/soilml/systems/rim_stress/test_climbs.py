"""From gentle climbs to the soil and to slopes not yet climbed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilml.numerics.quantiles import quantile_band
from soilml.systems.rim_stress import (
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
)
from soilml.systems.rim_stress.ability import compare_stress

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


def test_intervals_cover_the_truth_of_random_rovers(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[4] / "bench"))
    import climbing

    """Six rovers: three or fewer inside bands of nine tenths would come once in sixty."""
    fixed = ("cohesion", "friction_angle")
    rows = [row for seed in range(6) for row in climbing.predicted(seed, SLOPES, fixed)]
    for name in dict.fromkeys(row["of"] for row in rows):
        own = [row for row in rows if row["of"] == name]
        assert climbing.inside(own) > 0.6, name
        assert 0.3 < climbing.score(own) < 1.9, name
