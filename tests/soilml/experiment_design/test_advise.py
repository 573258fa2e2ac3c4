"""Which row to drive next: physics says where the information is."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError, InputError
from soilml.experiment_design import (
    advise,
    candidate_grid,
    is_identified,
    samples_of_prior,
    samples_of_rows,
)
from soilml.experiment_design.presentation import advice_as_json
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.prior import Prior

SOIL = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}
GRID = candidate_grid([0.05, 0.2, 0.6], [30.0, 60.0, 120.0])


@pytest.fixture
def case(model_file):
    return read_case(model_file)


def after(case, slip, load, **options):
    """Advice after rows driven so on SOIL without noise."""
    true = case.with_values(SOIL)
    at = Operating(slip=np.asarray(slip), load=np.asarray(load))
    torque = true.model(true.soil, at).torque
    run = np.full(len(slip), "a")
    table = Table({"run": run, "slip": at.slip, "load_N": at.load, "torque_Nm": torque})
    data = usable_readings(case, table)
    samples = samples_of_rows(case, data, select_free(case, None), 1024, exact_model=True)
    return advise(case, samples, GRID, measured=data.at, outcome_count=200, **options)


def test_a_second_load_identifies_cohesion_and_a_repetition_does_not(case):
    found = after(case, [0.6] * 3, [60.0] * 3)
    assert not is_identified(found.current_fraction)[0]
    best, repeat = found.best("cohesion"), found.best_repetition("cohesion")
    assert best.candidate.load != 60.0 and repeat.candidate.load == 60.0
    assert best.remaining_fraction[0] < 0.65 * repeat.remaining_fraction[0]


def test_the_best_rows_are_where_each_parameter_dominates_the_torque(case):
    samples = samples_of_prior(select_free(case, None), 1024)
    found = advise(case, samples, GRID)
    assert found.best("cohesion").candidate.load == 30.0
    assert found.best("friction_angle").candidate.load == 120.0
    assert found.best("shear_modulus").candidate.slip == 0.05
    assert found.best("cohesion").candidate.slip == 0.6


def test_drawbar_pull_helps_and_sinkage_does_not_where_bearing_is_known(case):
    noise = {"drawbar_pull_N": Noise(constant=0.5), "sinkage_m": Noise(constant=0.0005)}
    found = after(replace(case, noise=case.noise | noise), [0.2] * 3, [60.0] * 3)
    torque, pull, sinkage = (
        found.best("friction_angle", own).remaining_fraction[1] for own in found.channel_sets
    )
    assert [own[1:] for own in found.channel_sets] == [(), ("drawbar_pull",), ("sinkage",)]
    assert pull < torque - 0.03 and abs(sinkage - torque) < 0.02


def test_sinkage_helps_where_bearing_is_not_known(case):
    noise = case.noise | {"sinkage_m": Noise(constant=0.0005)}
    unknown = replace(case, noise=noise, prior=case.prior | {"n": Prior(0.6, 1.6)})
    found = advise(unknown, samples_of_prior(select_free(unknown, None), 1024), GRID)
    torque, sinkage = (found.best("n", own).remaining_fraction[3] for own in found.channel_sets)
    assert sinkage < 0.6 * torque


def test_each_row_of_a_sequence_reduces_the_variance_at_a_new_point(case):
    found = advise(case, samples_of_prior(select_free(case, None), 1500), GRID, count=3)
    overall = [c.overall for c in found.sequence]
    assert overall[0] == found.best().overall < 1.0
    assert overall[1] < 0.85 * overall[0] and overall[2] < 0.85 * overall[1]
    assert len({c.candidate for c in found.sequence}) == 3


@pytest.mark.slow
def test_the_realised_width_after_a_plan_is_the_expected_one(case):
    planned = advise(case, samples_of_prior(select_free(case, None), 1500), GRID, count=2).sequence
    points = [(c.candidate.slip, c.candidate.load) for c in planned]
    rng, free, left = np.random.default_rng(4), select_free(case, None), []
    slip, load = np.asarray(points).T
    for _ in range(16):
        true = case.with_values({f.path: float(f.prior.at(rng.random())) for f in free})
        torque = true.model(true.soil, Operating(slip=slip, load=load)).torque
        torque = torque * (1.0 + 0.02 * rng.standard_normal(2))
        run = np.asarray(["a", "a"])
        table = Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": torque})
        found = samples_of_rows(case, usable_readings(case, table), free, exact_model=True)
        left.append(found.remaining_fraction)
    realised = np.sqrt(np.mean(np.square(left), axis=0))
    np.testing.assert_allclose(
        planned[-1].remaining_fraction, realised, atol=0.15
    )  # 16 soils: 3 sigma


def test_points_without_equilibrium_on_possible_soils_are_excluded_and_counted(case):
    heavy = candidate_grid([0.2], [60.0, 1e6])
    found = advise(case, samples_of_prior(select_free(case, None), 64), heavy)
    assert found.excluded_points == 1 and {c.candidate.load for c in found.choices} == {60.0}
    with pytest.raises(FitError, match="smaller loads"):
        advise(case, samples_of_prior(select_free(case, None), 64), candidate_grid([0.2], [1e6]))


def test_impossible_slips_and_loads_are_refused():
    for slips, loads in (([1.0], [60.0]), ([0.1], [0.0]), ([float("nan")], [60.0])):
        with pytest.raises(InputError, match="cannot be driven"):
            candidate_grid(slips, loads)
    with pytest.raises(InputError, match="--loads"):
        candidate_grid(None, None)
    assert candidate_grid(None, None, [30.0, 60.0]).loads == (15.0, 25.0, 42.0, 71.0, 120.0)


def test_undeclared_noise_is_refused(case):
    silent = replace(case, noise={})
    with pytest.raises(InputError, match="declare it in"):
        advise(silent, samples_of_prior(select_free(case, None), 64), GRID)
    with pytest.raises(InputError, match="measured channels"):
        advise(case, samples_of_prior(select_free(case, None), 64), GRID, channels=("sinkage",))


def test_the_summary_has_slip_load_channels_and_every_fraction(case):
    content = advice_as_json(after(case, [0.2], [60.0]))["advice"]
    assert set(content) == {"next", "next_for", "repeat"}
    assert content["repeat"]["slip"] == 0.2 and content["next"]["channels"] == ["torque"]
    assert set(content["next_for"]) == set(content["next"]["remaining_fraction"]) == set(SOIL)
