"""Data checks: which data are analysed, which readings are excluded, and the messages."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven, fit_problem

from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.checks import check_readings, estimate_repeat_noise
from soilml.gap.evidence.directions import smooth_basis
from soilml.gap.evidence.outliers import outliers
from soilml.io.table import Table
from soilml.remarks import texts


def check(table, text=MODEL):
    case = case_of(text)
    readings = stack_readings(case, table)
    readings = readings.with_default_std(estimate_repeat_noise(readings)[0])
    return check_readings(readings, table, 3)


def changed(table, **columns):
    return replace(table, columns=table.columns | columns)


def joined(*tables):
    return Table({n: np.concatenate([t[n] for t in tables]) for n in tables[0].columns})


def test_valid_runs_pass_all_checks():
    found = check(driven(case_of()))
    assert found.errors == found.naming_obstacles == found.notes == ()


def test_only_planted_outliers_are_detected():
    case = case_of()
    table = driven(case, seed=4)
    problem = fit_problem(case, table)
    soil = problem.fit_soil([np.full(3, 0.5)])
    space = np.column_stack(
        [np.linalg.solve(problem.covariance.whiten, soil.jacobian), smooth_basis(problem.readings)]
    )
    residual = problem.readings.measured - soil.prediction
    assert not outliers(problem.covariance, residual, space).any()
    struck = np.isin(np.arange(len(residual)), (9, 50, 77))
    far = residual + np.where(struck, 9.0, 0.0) * problem.covariance.std
    np.testing.assert_array_equal(outliers(problem.covariance, far, space), struck)


@pytest.mark.parametrize("both", [True, False])
def test_a_reading_that_a_repeat_confirms_is_no_outlier(both):
    case = case_of()
    problem = fit_problem(case, driven(case, loads=(40.0, 40.0, 60.0, 90.0, 140.0), seed=4))
    soil = problem.fit_soil([np.full(3, 0.5)])
    residual = problem.readings.measured - soil.prediction
    space = np.linalg.solve(problem.covariance.whiten, soil.jacobian)
    struck = np.isin(np.arange(len(residual)), (3, 11) if both else (3,))  # runs 0 and 1
    far = residual + np.where(struck, 9.0, 0.0) * problem.covariance.std
    alike = problem.readings.replicates * 3 + problem.readings.channel
    run = problem.readings.run[problem.readings.row]
    found = outliers(problem.covariance, far, space, alike, run)
    np.testing.assert_array_equal(found, struck & (not both))
    np.testing.assert_array_equal(outliers(problem.covariance, far, space), struck)


def test_a_repeat_that_strays_to_the_other_side_confirms_nothing():
    case = case_of()
    problem = fit_problem(case, driven(case, loads=(40.0, 40.0, 60.0, 90.0, 140.0), seed=4))
    soil = problem.fit_soil([np.full(3, 0.5)])
    far = problem.readings.measured - soil.prediction
    far[3] += 9.0 * problem.covariance.std[3]
    far[11] -= 9.0 * problem.covariance.std[11]
    space = np.linalg.solve(problem.covariance.whiten, soil.jacobian)
    alike = problem.readings.replicates * 3 + problem.readings.channel
    found = outliers(problem.covariance, far, space, alike)
    np.testing.assert_array_equal(np.flatnonzero(found), [3, 11])


def test_loads_that_scatter_about_one_level_are_reported_as_one():
    loads = 20.0 * (1.0 + np.random.default_rng(3).uniform(-0.08, 0.08, 8))
    table = driven(case_of(), loads=tuple(loads))
    assert any("one load only" in reason for reason in texts(check(table).naming_obstacles))


@pytest.mark.parametrize(
    "how, said",
    [
        ({"loads": (60.0, 60.0, 60.0)}, "one load only"),
        ({"loads": (60.0,), "slips": 24}, "one run only"),
        ({"slips": 2, "loads": (40.0, 60.0, 80.0, 100.0)}, "fewer than three slips"),
    ],
)
def test_obstacles_to_naming_a_cause_are_reported(how, said):
    found = check(driven(case_of(), **how))
    assert found.errors == ()
    assert any(said in reason for reason in texts(found.naming_obstacles))


def test_a_constant_sensor_is_an_error():
    table = driven(case_of())
    found = check(changed(table, sinkage_m=np.full(len(table), 0.01)))
    assert texts(found.errors) == ["sinkage_m is the same in every row: check the sensor"]


def test_too_few_readings_are_an_error():
    table = driven(case_of(), loads=(40.0, 80.0), slips=1)
    assert "6 readings for 3 soil parameters" in check(table).errors[0].text
    few = check(driven(case_of(), loads=(40.0, 80.0, 120.0), slips=1))
    assert few.errors == ()
    text = "9 readings for 3 soil parameters: at least 11 readings are needed to name a cause"
    assert text in texts(few.naming_obstacles)


def test_a_table_without_any_reading_is_refused():
    table = driven(case_of())
    blank = np.full(len(table), np.nan)
    found = check(changed(table, torque_Nm=blank, drawbar_pull_N=blank, sinkage_m=blank))
    assert texts(found.errors) == ["no torque, drawbar pull or sinkage was measured"]


QUIET = MODEL.replace('sinkage_m = "1 %"\n', "")


def test_undeclared_noise_is_an_error():
    found = check(driven(case_of()), QUIET)
    assert len(found.errors) == 1
    assert 'give [noise] sinkage_m, as in sinkage_m = "2 %", or a column' in found.errors[0].text


def test_a_column_of_standard_deviations_declares_noise():
    table = driven(case_of())
    assert check(changed(table, sinkage_m_std=np.full(len(table), 1e-4)), QUIET).errors == ()


def test_undeclared_noise_is_estimated_from_repeated_rows():
    case = case_of(QUIET)
    table = joined(*[driven(case_of(), loads=(60.0, 60.0, 90.0, 90.0), seed=s) for s in range(6)])
    rng = np.random.default_rng(0)
    spread = 2e-4 * rng.standard_normal(len(table))
    table = changed(
        table,
        sinkage_m=driven(case_of(), loads=(60.0, 60.0, 90.0, 90.0) * 6, noise=0.0)["sinkage_m"]
        + spread,
    )
    found, notes = estimate_repeat_noise(stack_readings(case, table))
    assert list(found) == ["sinkage"]
    assert found["sinkage"] == pytest.approx(2e-4, rel=0.2)
    assert "noise of sinkage_m is not declared" in notes[0].text
    assert check(table, QUIET).errors == ()


def test_the_report_on_bad_data_says_what_was_left_out_and_counts_only_what_prevents_it():
    whole = case_of()
    case = replace(whole, noise={"torque_Nm": whole.noise["torque_Nm"]})
    table = driven(whole, loads=(60.0,), slips=6)
    report = gap(case, table)
    assert [reason.code for reason in report.reasons] == ["few-readings"]
    assert report.sentence == report.reasons[0].text
    unused = [note.about for note in report.notes if note.code == "unused-channel"]
    assert sorted(unused) == [("drawbar_pull_N",), ("sinkage_m",)]
    assert {"one-run", "one-load"} <= {note.code for note in report.notes}
