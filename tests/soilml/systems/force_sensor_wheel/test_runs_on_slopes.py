"""Shear modulus and pull of runs on slopes: intervals cover what was put in."""

import math

import numpy as np
import pytest

from soilml.io.table import Table
from soilml.systems.force_sensor_wheel import MohrCoulomb, SensingWheel, SteadyRun, balanced_arc
from soilml.systems.force_sensor_wheel.runs_on_slopes import read_stresses, solve_runs

STRENGTH, MODULUS = MohrCoulomb(friction_angle=math.radians(38.0)), 0.0072
RUNS = {"flat": (0.11, 0.0), "up6": (0.39, math.radians(6.0))}


@pytest.mark.slow
def test_intervals_of_modulus_and_pull_cover_noise_of_stress_and_of_slip():
    """5 % of each point of 41 of the rim, and 0.01 of the slip: 90 % intervals of 100 campaigns."""
    rng, wheel, inside = np.random.default_rng(2), SensingWheel(), []
    arcs = {}
    for name, (slip, slope) in RUNS.items():
        at = SteadyRun(slip=slip, weight=28.92, slope=slope)
        arcs[name] = balanced_arc(math.radians(30.0), at, wheel, STRENGTH, MODULUS)
    for _ in range(100):
        runs, columns = {}, {"run": [], "angle_rad": [], "normal_Pa": []}
        for name, (slip, slope) in RUNS.items():
            read = slip + 0.01 * rng.standard_normal()
            runs[name] = SteadyRun(slip=read, weight=28.92, slope=slope, slip_std=0.01)
            normal = arcs[name].normal[::5] * (1.0 + 0.05 * rng.standard_normal(41))
            columns["run"] += [name] * 41
            columns["angle_rad"] += arcs[name].angle[::5].tolist()
            columns["normal_Pa"] += normal.tolist()
        table = Table({name: np.asarray(values) for name, values in columns.items()})
        found = solve_runs(runs, read_stresses(table), wheel, STRENGTH)
        share = found.shear_modulus_std / found.shear_modulus
        modulus = np.abs(np.log(found.shear_modulus / MODULUS)) < 1.645 * share
        pull = np.abs(found.drawbar_pull - found.required) < 1.645 * found.drawbar_pull_std
        inside.append([*modulus, pull[1]])
    covered = np.mean(inside, axis=0)
    assert np.all((covered >= 0.85) & (covered <= 0.95)), covered
