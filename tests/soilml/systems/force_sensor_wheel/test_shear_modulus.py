"""From what force sensors in the rim read to the soil's shear modulus and the drawbar pull."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilml import ExitAngle, Model, Operating, StressShift, Wheel, soil
from soilml.errors import FitError, InputError
from soilml.systems.force_sensor_wheel import (
    MohrCoulomb,
    SensingWheel,
    SensorReadings,
    SteadyRun,
    StressProfile,
    balanced_arc,
    bin_stress,
    deconvolve,
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


def test_a_sensor_reads_the_mean_over_its_disc():
    flat = StressProfile(np.asarray([-0.8, -0.79, 0.8, 0.81]), np.asarray([0.0, 2e4, 2e4, 0.0]))
    force = simulate_readings(flat, QUIET, turns=1).force
    assert force.max() == pytest.approx(2e4 * math.pi * 0.00475**2, rel=1e-9)
    edge = simulate_readings(flat, replace(QUIET, deadband=0.0), turns=200)
    at_edge = np.abs(edge.angle - 0.805) < 0.003
    assert edge.force[at_edge].mean() == pytest.approx(0.5 * force.max(), rel=0.03)


def test_deadband_and_saturation_limit_the_readings():
    force = simulate_readings(arc(), NOISY, turns=2).force
    assert force[force > 0].min() >= 0.1
    strong = simulate_readings(
        StressProfile(arc().angle, 10.0 * arc().normal), NOISY, turns=2
    ).force
    assert strong.max() == 4.4


def test_uncorrected_readings_lengthen_the_arc_and_overestimate_k():
    binned = bin_stress(simulate_readings(arc(), QUIET), QUIET)
    raw = StressProfile(binned.angle, binned.normal)
    assert raw.entry_angle > arc().entry_angle + 0.01
    assert solve_force_balance(raw, LEVEL, QUIET, STRENGTH).shear_modulus > 1.08 * TRUE


@pytest.mark.parametrize("at", [LEVEL, UP], ids=["level", "uphill"])
@pytest.mark.parametrize("lean", [-0.4, 0.0])
def test_the_modulus_is_recovered_through_noiseless_sensors(at, lean):
    readings = simulate_readings(arc(at, lean), QUIET, crown=0.3, lugs=(0.3, 0.3))
    found = solve_force_balance(profile_from_readings(readings, QUIET), at, QUIET, STRENGTH)
    assert found.shear_modulus == pytest.approx(TRUE, rel=0.02)
    assert found.magnification == pytest.approx(1.0 / 0.7, rel=0.03)


def test_the_modulus_of_a_wheel_with_stress_shift_is_recovered():
    model = Model(Wheel(radius=0.055, width=0.064)) + ExitAngle(kappa=0.1) + StressShift(shift=0.3)
    sand, at = soil("nagatani2009/toyoura_sand"), Operating(slip=0.3, load=20.0)
    force, p = model(sand, at), model.profile(sand, at, points=401)
    true = StressProfile(p.angle[::-1], np.maximum(p.normal[::-1], 0.0))
    slope = math.atan2(force.drawbar_pull, 20.0)
    run = SteadyRun(slip=0.3, weight=math.hypot(20.0, force.drawbar_pull), slope=slope)
    found = solve_force_balance(
        profile_from_readings(simulate_readings(true, QUIET), QUIET), run, QUIET, STRENGTH
    )
    assert found.shear_modulus == pytest.approx(TRUE, rel=0.02)


def test_lugs_that_carry_more_in_front_cause_k_to_be_overestimated():
    """M is one number: it cannot follow the lugs along the arc."""
    even, front = (
        solve_force_balance(
            profile_from_readings(simulate_readings(arc(), QUIET, lugs=lugs), QUIET),
            LEVEL,
            QUIET,
            STRENGTH,
        )
        for lugs in ((0.3, 0.3), (0.5, 0.1))
    )
    assert front.shear_modulus > 1.1 * even.shear_modulus
    assert front.magnification == pytest.approx(even.magnification, rel=0.02)


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


@pytest.mark.slow
def test_noise_and_slip_uncertainty_widen_the_estimate():
    def std(noise, slip_std):
        wheel = replace(NOISY, noise=noise)
        at = replace(LEVEL, slip_std=slip_std)
        return estimate_shear_modulus(
            simulate_readings(arc(), wheel), at, wheel, STRENGTH
        ).shear_modulus_std

    assert std(0.05, 0.0) > 1.3 * std(0.0, 0.0)
    assert std(0.02, 0.02) > 2.0 * std(0.02, 0.0)


def test_a_pull_beyond_the_valid_slips_carries_a_warning():
    grip = estimate_shear_modulus(simulate_readings(arc(), QUIET), LEVEL, QUIET, STRENGTH)
    fast = SteadyRun(slip=0.8, weight=WEIGHT, slope=math.radians(8.0))
    found = predict_pull(simulate_readings(arc(fast), QUIET), fast, QUIET, STRENGTH, grip)
    assert [(r.code, r.about) for r in found.warnings] == [("outside-valid-slip", ("slip",))]
    assert found.drawbar_pull == pytest.approx(WEIGHT * math.sin(fast.slope), abs=0.3)


def test_uninformative_readings_are_refused():
    readings = simulate_readings(arc(), QUIET, turns=2)
    with pytest.raises(InputError, match="without contact"):
        bin_stress(SensorReadings(readings.angle, 0.0 * readings.force), QUIET)
    with pytest.raises(FitError, match="turns"):
        estimate_shear_modulus(readings, LEVEL, QUIET, STRENGTH)
    with pytest.raises(FitError, match="bins of the rim"):
        weak = replace(QUIET, saturation=0.15)
        deconvolve(bin_stress(simulate_readings(arc(), weak), weak), weak)
    with pytest.raises(FitError, match="single stress arc"):
        both = SensorReadings(readings.angle, readings.force + np.roll(readings.force, 85, axis=1))
        deconvolve(bin_stress(both, QUIET), QUIET)
    with pytest.raises(InputError, match="whole number"):
        replace(QUIET, sensors=2.5)
    with pytest.raises(InputError, match="radians"):
        SensorReadings(np.rad2deg(readings.angle), readings.force)
    with pytest.raises(InputError, match="shape"):
        SensorReadings(readings.angle[0], readings.force)
    with pytest.raises(InputError, match="deadband"):
        replace(QUIET, saturation=0.05)
    with pytest.raises(InputError, match="lugs"):
        simulate_readings(arc(), QUIET, lugs=(1.0, 0.0))
    with pytest.raises(InputError, match="turns"):
        simulate_readings(arc(), QUIET, turns=0)


def test_the_example_on_the_page_runs():
    page = (Path(__file__).parents[4] / "docs/papers/nagatani2009.md").read_text()
    names: dict = {}
    exec(re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0], names)
    assert names["modulus"].interval[0] < TRUE < names["modulus"].interval[1]


def test_readings_of_another_row_of_sensors_are_refused():
    angle = np.zeros((3, 5))
    with pytest.raises(InputError, match="readings of 2 sensors; the wheel has 4 in a row"):
        bin_stress(SensorReadings(angle, np.ones((3, 5, 2))), SensingWheel())
