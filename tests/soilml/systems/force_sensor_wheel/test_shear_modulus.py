"""From what force sensors in the rim read to the soil's shear modulus and the drawbar pull."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilml.systems.force_sensor_wheel import (
    MohrCoulomb,
    SensingWheel,
    SteadyRun,
    balanced_arc,
    estimate_shear_modulus,
    predict_pull,
    profile_from_readings,
    simulate_readings,
    solve_force_balance,
)

NOISY = SensingWheel()
QUIET = replace(NOISY, noise=0.0)
TRUE, WEIGHT = 0.0072, 28.92
STRENGTH = MohrCoulomb(friction_angle=math.radians(38.0))
LEVEL = SteadyRun(slip=0.11, weight=WEIGHT)
UP = SteadyRun(slip=0.29, weight=WEIGHT, slope=math.radians(4.0))


def arc(at=LEVEL, lean=0.0):
    return balanced_arc(math.radians(30.0), at, QUIET, STRENGTH, TRUE, lean)


@pytest.mark.parametrize("at", [LEVEL, UP], ids=["level", "uphill"])
@pytest.mark.parametrize("lean", [-0.4, 0.0])
def test_the_modulus_is_recovered_through_noiseless_sensors(at, lean):
    readings = simulate_readings(arc(at, lean), QUIET, crown=0.3, lugs=(0.3, 0.3))
    found = solve_force_balance(profile_from_readings(readings, QUIET), at, QUIET, STRENGTH)
    assert found.shear_modulus == pytest.approx(TRUE, rel=0.02)
    assert found.magnification == pytest.approx(1.0 / 0.7, rel=0.03)


def test_a_saturated_peak_is_inferred_from_the_flanks_with_a_warning():
    weak = replace(QUIET, saturation=1.2)
    readings = simulate_readings(arc(), weak)
    grip = estimate_shear_modulus(readings, LEVEL, weak, STRENGTH)
    assert "saturated" in [remark.code for remark in grip.warnings]
    assert grip.shear_modulus == pytest.approx(TRUE, rel=0.05)
    assert not estimate_shear_modulus(
        simulate_readings(arc(), QUIET), LEVEL, QUIET, STRENGTH
    ).warnings


@pytest.mark.long
def test_intervals_have_the_nominal_coverage():
    rng, runs = np.random.default_rng(7), 50
    held = pulled = 0
    apart = []
    level, up = ([arc(at, lean) for lean in (-0.3, 0.0, 0.3)] for at in (LEVEL, UP))

    def driven(at):
        return replace(
            at,
            slip=at.slip + 0.0133 * rng.normal(),
            weight=at.weight + 0.3 * rng.normal(),
            slip_std=0.0133,
            weight_std=0.3,
        )

    for i in range(runs):
        first = simulate_readings(level[i % 3], NOISY, turns=5, crown=0.3, lugs=(0.3, 0.3), seed=i)
        grip = estimate_shear_modulus(first, driven(LEVEL), NOISY, STRENGTH)
        held += grip.interval[0] <= TRUE <= grip.interval[1]
        apart.append(math.log(grip.shear_modulus / TRUE) / math.sqrt(grip.covariance[0, 0]))
        later = simulate_readings(
            up[i % 3], NOISY, turns=5, crown=0.3, lugs=(0.3, 0.3), seed=runs + i
        )
        found = predict_pull(later, driven(UP), NOISY, STRENGTH, grip)
        pulled += found.interval[0] <= WEIGHT * math.sin(UP.slope) <= found.interval[1]
    assert held / runs == pytest.approx(0.9, abs=0.1)
    assert pulled / runs == pytest.approx(0.9, abs=0.1)
    assert float(np.std(apart)) == pytest.approx(1.0, abs=0.3)
