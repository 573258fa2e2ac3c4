"""Soil from climbs: what they determine, and what they do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilml.systems.climbing import SimulatedRover, identify_ground

pytestmark = pytest.mark.slow

SAND = {"cohesion": 0.0, "friction_angle": float(np.deg2rad(38.0))}
SLOPES = np.deg2rad([0.0, 4.0, 8.0, 12.0]).tolist()


@pytest.fixture(scope="module")
def true():
    return SimulatedRover()


@pytest.fixture(scope="module")
def climbs(true):
    return true.simulate_climbs(np.random.default_rng(5), SLOPES, 3)


def test_the_shear_modulus_is_identified_with_known_strength(true, climbs):
    ground = identify_ground(true.rover, climbs, fixed=SAND)
    assert ground.fit.names == ("shear_modulus",)
    error = ground.fit["shear_modulus"] - true.shear[2]
    assert abs(error) < 3.0 * ground.fit.std[0] < 0.003
    assert ground.fit.remaining_fraction["shear_modulus"] < 0.1
    assert np.all(ground.samples[:, 0] == 0.0)


def test_unknown_wheel_loads_give_the_same_soil(true, climbs):
    unknown = replace(true.rover, front_share=None, height_ratio=None)
    known, shared = (
        identify_ground(rover, climbs, fixed=SAND).fit for rover in (true.rover, unknown)
    )
    assert shared.values[0] == pytest.approx(known.values[0], abs=2.0 * known.std[0])


def test_intervals_cover_the_truth_of_random_rovers(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[4] / "bench"))
    import climbing

    """Six rovers: three or fewer inside bands of nine tenths would come once in sixty."""
    fixed, slopes = ("cohesion", "friction_angle"), np.deg2rad([0.0, 4.0]).tolist()
    rows = [row for seed in range(6) for row in climbing.predicted(seed, slopes, fixed, True)]
    for name in dict.fromkeys(row["of"] for row in rows):
        own = [row for row in rows if row["of"] == name]
        assert climbing.inside(own) > 0.6, name
        assert 0.3 < climbing.score(own) < 1.9, name
