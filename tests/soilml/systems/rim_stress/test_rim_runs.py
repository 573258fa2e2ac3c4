"""From what sensors in the rim read to k_x, pull and slope: intervals cover what was put in."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilml import soil
from soilml.systems.rim_stress import (
    MeasuredStress,
    SensingWheel,
    SteadyRun,
    balanced_arc,
    bin_stress,
    simulate_readings,
    solve_runs,
)

NOISY, TRUE, WEIGHT = SensingWheel(), 0.0072, 28.92
QUIET = replace(NOISY, noise=0.0)
SAND = soil("nagatani2009/toyoura_sand")
RUNS = {
    "flat": SteadyRun(slip=0.11, weight=WEIGHT),
    "up6": SteadyRun(slip=0.39, weight=WEIGHT, slope=math.radians(6.0)),
}


def arcs(lean=0.0):
    return {
        name: balanced_arc(math.radians(30.0), at, QUIET, SAND, lean) for name, at in RUNS.items()
    }


def inside(found, name="up6"):
    """Whether intervals of k_x, pull and slope of a run cover the truth."""
    k, at = list(RUNS).index(name), RUNS[name]
    value = {column: values[k] for column, values in found.columns.items()}
    share = value["shear_modulus_m_std"] / value["shear_modulus_m"]
    pull = WEIGHT * math.sin(at.slope)
    return [
        abs(math.log(value["shear_modulus_m"] / TRUE)) < 1.645 * share,
        abs(value["drawbar_pull_N"] - pull) < 1.645 * value["drawbar_pull_N_std"],
        abs(value["slope_climbed_rad"] - at.slope) < 1.645 * value["slope_climbed_rad_std"],
    ]


@pytest.mark.slow
def test_intervals_cover_noise_of_stress_and_of_slip():
    """5 % of each point of 41 of the rim, and 0.01 of the slip: 90 % intervals of 40 campaigns."""
    rng, true, covered = np.random.default_rng(2), arcs(), []
    for _ in range(40):
        runs, stresses = {}, {}
        for name, at in RUNS.items():
            read = at.slip + 0.01 * rng.standard_normal()
            runs[name] = replace(at, slip=read, slip_std=0.01)
            normal = true[name].normal[::5] * (1.0 + 0.05 * rng.standard_normal(41))
            angle = true[name].angle[::5]
            stresses[name] = MeasuredStress(angle, normal, 0.05 * normal, normal > 0.0)
        covered.append(inside(solve_runs(runs, stresses, QUIET, SAND)))
    share = np.mean(covered, axis=0)
    assert np.all((share >= 0.8) & (share <= 0.975)), share


@pytest.mark.parametrize("lean", [-0.4, 0.0])
def test_the_modulus_is_recovered_through_sensors_and_lugs(lean):
    readings = {
        name: bin_stress(simulate_readings(arc, QUIET, crown=0.3, lugs=(0.3, 0.3)), QUIET)
        for name, arc in arcs(lean).items()
    }
    found = solve_runs(RUNS, readings, QUIET, SAND, discs=True)
    assert found.columns["shear_modulus_m"] == pytest.approx(TRUE, rel=0.02)
    assert found.columns["magnification"] == pytest.approx(1.0 / 0.7, rel=0.03)
    assert not found.warnings


def test_a_saturated_peak_is_inferred_from_the_flanks_with_a_warning():
    weak = replace(QUIET, saturation=1.2)
    readings = {n: bin_stress(simulate_readings(a, weak), weak) for n, a in arcs().items()}
    found = solve_runs(RUNS, readings, weak, SAND, discs=True)
    assert [remark.code for remark in found.warnings] == ["saturated"]
    assert found.columns["shear_modulus_m"] == pytest.approx(TRUE, rel=0.05)


@pytest.mark.long
def test_intervals_cover_noise_of_readings_of_five_turns():
    rng, covered = np.random.default_rng(7), []
    for i in range(24):
        true = arcs((-0.3, 0.0, 0.3)[i % 3])
        runs = {
            name: replace(at, slip=at.slip + 0.0133 * rng.normal(), slip_std=0.0133)
            for name, at in RUNS.items()
        }
        readings = {
            name: bin_stress(
                simulate_readings(arc, NOISY, turns=5, crown=0.3, lugs=(0.3, 0.3), seed=2 * i + k),
                NOISY,
            )
            for k, (name, arc) in enumerate(true.items())
        }
        covered.append(inside(solve_runs(runs, readings, NOISY, SAND, discs=True)))
    share = np.mean(covered, axis=0)
    assert np.all((share >= 0.8) & (share <= 1.0)), share
