"""Soil from climbs: what they determine, and what they do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from remarked import remarked

from soilml.errors import FitError, InputError
from soilml.numerics.prior import Prior
from soilml.systems.climbing import SimulatedRover, Uncertainty, identify_ground, modulus_per_climb

pytestmark = pytest.mark.slow

SAND = {"cohesion": 0.0, "friction_angle": float(np.deg2rad(38.0))}
SLOPES = np.deg2rad([0.0, 4.0, 8.0, 12.0]).tolist()


@pytest.fixture(scope="module")
def true():
    return SimulatedRover()


@pytest.fixture(scope="module")
def climbs(true):
    return true.simulate_climbs(np.random.default_rng(5), SLOPES, 3)


@pytest.fixture(scope="module")
def exact():
    noise = Uncertainty(speed=0.0, slope=0.0, entry_angle=0.0, front_load=0.0)
    return SimulatedRover(noise=noise, stress=0.0)


def test_the_shear_modulus_is_identified_with_known_strength(true, climbs):
    ground = identify_ground(true.rover, climbs, fixed=SAND)
    assert ground.fit.names == ("shear_modulus",)
    error = ground.fit["shear_modulus"] - true.shear[2]
    assert abs(error) < 3.0 * ground.fit.std[0] < 0.003
    assert ground.fit.remaining_fraction["shear_modulus"] < 0.1
    assert np.all(ground.samples[:, 0] == 0.0)


def test_cohesion_is_reported_as_not_identified(true, climbs):
    ground = identify_ground(true.rover, climbs)
    assert ground.fit.remaining_fraction["cohesion"] > 0.8
    assert remarked(ground.fit.warnings, "cohesion is not identified")


def test_each_parameter_needs_a_slope_of_its_own(true, climbs):
    two = [c for c in climbs if c.slope < 0.1]
    with pytest.raises(FitError, match=r"2 slopes for 3 parameters.*needed are 3 different slopes"):
        identify_ground(true.rover, two)
    with pytest.raises(FitError, match="no climb for 1 parameter"):
        identify_ground(true.rover, [], fixed=SAND)
    identify_ground(true.rover, two, fixed=SAND)


def test_unknown_wheel_loads_give_the_same_soil(true, climbs):
    unknown = replace(true.rover, front_share=None, height_ratio=None)
    known, shared = (
        identify_ground(rover, climbs, fixed=SAND).fit for rover in (true.rover, unknown)
    )
    assert shared.values[0] == pytest.approx(known.values[0], abs=2.0 * known.std[0])


def test_a_climb_beyond_the_largest_pull_is_refused_by_name(true, climbs):
    steep = [replace(climbs[0], name="cliff", slope=0.9), *climbs[1:]]
    with pytest.raises(InputError, match=r"run cliff: a slope of 0.9 rad requires .* at most"):
        identify_ground(true.rover, steep)
    narrow = {"shear_modulus": Prior(0.03, 0.05, log=True)}
    with pytest.raises(InputError, match="at most"):
        identify_ground(true.rover, climbs, fixed=SAND, prior=narrow)


def test_climbs_that_contradict_each_other_are_refused(true, climbs):
    odd = [replace(climbs[-1], name="odd", slope=0.45), *climbs[:-1]]
    with pytest.raises(FitError, match=r"no single soil.*run odd"):
        identify_ground(true.rover, odd, fixed=SAND)


def test_an_unknown_parameter_is_refused(true, climbs):
    with pytest.raises(InputError, match="no soil parameter 'k'"):
        identify_ground(true.rover, climbs, fixed={"k": 1.0})


def test_a_speed_error_affects_the_shear_modulus_most_at_low_slip(exact):
    climbs = exact.simulate_climbs(np.random.default_rng(1), SLOPES, 1)
    size = {"cohesion": 0.0, "friction_angle": SAND["friction_angle"]}
    low, as_read, high = (
        modulus_per_climb(exact.rover, climbs, speed_error=e, **size) for e in (-0.015, 0.0, 0.015)
    )
    assert np.all(low > as_read) and np.all(high < as_read)
    assert np.all(np.diff((low - high) / as_read) < 0.0)
    assert (low[0] - high[0]) / as_read[0] > 5.0 * (low[-1] - high[-1]) / as_read[-1]


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
