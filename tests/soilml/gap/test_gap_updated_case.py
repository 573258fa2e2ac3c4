"""The updated case as a file, and the proposed next runs."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import MODEL, candidate, case_of, driven, fit_problem

from soilml.config.write_case import case_as_toml
from soilml.gap.design.discriminating_runs import next_runs
from soilml.gap.design.planned_readings import expected_readings
from soilml.gap.design.run_kinds import SENSOR_CHECKS
from soilml.gap.design.run_options import run_options
from soilml.gap.verdict.estimates import updated_case
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating

AT = Operating(
    slip=np.asarray([-0.3, 0.1, 0.4, 0.7]), load=np.asarray([30.0, 60.0, 90.0, 150.0]), speed=0.05
)
CHANNELS = ("torque", "drawbar_pull", "sinkage")

EFFECTED = (
    MODEL
    + """\
[[effect]]
name = "slip-sinkage"
n1 = 0.3712345678901234
by_slip = -1.2345678901234
by_load = 0.1
[effect.prior]
n1 = [0.0, 1.0]
[[effect]]
name = "rate"
a = 0.07
[[effect]]
name = "torque-offset"
offset = 1e-05
"""
)


def same_forces(one, other):
    mine, theirs = (case.model(case.soil, AT) for case in (one, other))
    for name in CHANNELS:
        np.testing.assert_allclose(
            getattr(mine, name), getattr(theirs, name), rtol=1e-12, atol=1e-15
        )


@pytest.mark.parametrize(
    "text",
    [
        MODEL,
        EFFECTED,
        MODEL.replace('"wheel"', '"linear-wheel"'),
        MODEL.replace("cohesion = [0.0, 3000.0]", 'kphi = { range = [1e5, 1e7], scale = "log" }'),
        MODEL.replace('"1 %"', "0.05", 1),
    ],
)
def test_a_model_written_and_read_again_predicts_the_same(text):
    case = case_of(text)
    again = case_of(case_as_toml(case, ["a comment", "another one"]))
    same_forces(case, again)
    assert again.prior == case.prior
    assert again.noise == case.noise
    assert again.model == case.model
    assert case_as_toml(again) == case_as_toml(case)


def test_a_soil_of_any_digits_is_kept_to_the_last():
    case = case_of().with_values(
        {"cohesion": 1 / 3, "friction_angle": 0.1 + 0.4, "kphi": 1.23456789012e-3 * 1e9}
    )
    again = case_of(case_as_toml(case))
    assert again.soil == case.soil


def test_noise_of_any_digits_is_kept_to_the_last():
    case = case_of(MODEL.replace('"1 %"', '"1.23456789 %"'))
    assert case_of(case_as_toml(case)).noise == case.noise


@pytest.fixture(scope="module")
def rivals():
    """Two explanations of runs in which the wheel digs itself in."""
    case = case_of()
    problem = fit_problem(case, driven(case, [EFFECTS["slip-sinkage"](n1=0.4)], seed=2))
    start = problem.fit_soil([np.full(3, 0.5)]).start_values()
    return problem, [candidate(problem, [name], start) for name in ("slip-sinkage", "torque-gain")]


def test_the_updated_case_is_the_fit_with_priors_of_the_added_effects(rivals):
    problem, (one, _) = rivals
    case = updated_case(one.fit, {"torque_Nm": 0.2})
    assert case.discrepancy["torque_Nm"].amplitude(7.0) == 0.2
    size = case.prior.pop("slip-sinkage.n1")
    assert size.lower < one.fit.values()["slip-sinkage.n1"] < size.upper
    assert case.prior == problem.case.prior and case.noise == problem.case.noise
    assert [e.name for e in case.model.effects] == ["slip-sinkage"]
    fitted = one.fit.values()["slip-sinkage.n1"]
    assert case.model.effects[0].n1 == float(f"{fitted:.6g}") != fitted
    same_forces(case, case_of(case_as_toml(case)))


def test_run_options_extend_the_operating_range(rivals):
    readings = rivals[0].readings
    options = {option.kind: option.at for option in run_options(readings, rivals[0].case, [])}
    assert options["heavier"].load[0] > readings.load.max()
    assert options["lighter"].load[0] < readings.load.min()
    assert options["higher slip"].slip.max() > readings.slip.max()
    assert (options["braking"].slip < 0.0).all()
    assert (options["reverse"].speed < 0.0).all()
    assert (options["second pass"].pass_number == 2.0).all()
    for at in options.values():
        assert np.all(np.abs(at.slip) < 1.0)


def test_a_covariate_that_was_varied_is_not_suggested_again():
    case = case_of()
    table = driven(case, loads=(40.0, 60.0, 90.0), slips=4, speed=(0.02, 0.05, 0.1))
    kinds = {option.kind for option in run_options(fit_problem(case, table).readings, case, [])}
    assert "other speed" not in kinds and "second pass" in kinds


def test_expected_readings_have_the_channels_and_noise_of_the_rig(rivals):
    problem = rivals[0]
    option = next(iter(run_options(problem.readings, problem.case, [])))
    readings = expected_readings(option.at, problem.readings, problem.case)
    assert len(readings) == 3 * len(option.at.slip)
    torque = readings.channel == 0
    np.testing.assert_allclose(readings.std[torque], 0.01 * np.abs(readings.measured[torque]))


def test_proposals_are_ranked_and_contain_predictions(rivals):
    problem, both = rivals
    found = next_runs(problem, both)
    apart = [run.discrimination for run in found]
    assert apart == sorted(apart, reverse=True) and apart[0] > 0.0
    driving = next(run for run in found if run.rows)
    row = driving.rows[-1]
    assert {"slip", "load_N", "torque_Nm if slip-sinkage", "sinkage_m if torque-gain"} <= set(row)
    case = both[0].fit.fitted()
    known = {"speed": row["speed_m_s"]} if "speed_m_s" in row else {}
    force = case.model(case.soil, Operating(slip=row["slip"], load=row["load_N"], **known))
    assert row["torque_Nm if slip-sinkage"] == pytest.approx(float(force.torque))


def test_a_sensor_check_distinguishes_a_fault_from_physics(rivals):
    found = {run.kind: run for run in next_runs(*rivals)}
    gain = abs(rivals[1][1].fit.values()["torque-gain.gain"])
    assert found["dead-weight torque"].discrimination == pytest.approx(min(gain / 0.003, 10.0))
    assert all(run.rows == () for kind, run in found.items() if kind in SENSOR_CHECKS)


def test_one_explanation_gives_no_proposals(rivals):
    problem, both = rivals
    assert next_runs(problem, both[:1]) == []


def test_equal_explanations_cannot_be_discriminated(rivals):
    problem, (one, _) = rivals
    twin = replace(one, names=("twin",))
    assert all(run.discrimination < 1e-3 for run in next_runs(problem, [one, twin]) if run.rows)
