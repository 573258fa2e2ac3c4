"""Gap reductions, and the readings that cross-validation holds out."""

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.gap.evidence.held_out import INFEASIBLE_SQUARE, _run_folds, held_out_region
from soilml.gap.verdict.reductions import gap_reduction


def test_a_gap_is_the_mean_square_over_noise_by_channel():
    case = case_of()
    problem = fit_problem(case, driven(case))
    readings, std = problem.readings, np.full(len(problem.readings), 0.5)
    before = readings.measured + np.where(readings.channel == 1, 1.0, 0.5)
    after = readings.measured + 0.25
    after[0] = np.nan
    found = gap_reduction(readings, std, before, after, "all")
    n = len(readings)
    assert found.before == pytest.approx((2.0 * 1.0 + 4.0) / 3.0)
    assert found.after == pytest.approx((0.25 * (n - 1) + INFEASIBLE_SQUARE) / n)
    assert found.channels["drawbar_pull_N"] == pytest.approx((4.0, 0.25))
    assert found.channels["torque_Nm"][1] == pytest.approx((0.25 * 31 + INFEASIBLE_SQUARE) / 32)
    assert INFEASIBLE_SQUARE == 100.0 and (found.readings, found.description) == (n, "all")


@pytest.mark.parametrize(
    "loads, slips, name, share",
    [
        ((40.0, 60.0, 90.0, 140.0), 8, "load_N >= 140", 0.25),
        ((40.0, 60.0, 90.0), 8, "load_N >= 90", 1 / 3),
        ((40.0, 50.0, 60.0, 70.0, 80.0), 4, "load_N >= 80", 0.2),
        ((40.0, 50.0, 60.0, 70.0, 80.0, 90.0), 4, "load_N >= 80", 1 / 3),
        ((60.0, 60.0), 10, "slip >= 0.48", 0.3),
    ],
)
def test_the_region_held_out_is_three_tenths_of_the_readings(loads, slips, name, share):
    case = case_of()
    readings = fit_problem(case, driven(case, loads=loads, slips=slips)).readings
    found, out = held_out_region(readings)
    assert found == name and out.mean() == pytest.approx(share)
    values = readings.load if name.startswith("load") else readings.slip
    assert values[out].min() > values[~out].max()


def test_no_region_is_held_out_where_hardly_anything_varies():
    case = case_of()
    readings = fit_problem(case, driven(case, loads=(40.0, 60.0), slips=2)).readings
    assert held_out_region(readings) is None and _run_folds(readings, 0) is None


@pytest.mark.parametrize("runs, folds", [(3, 3), (4, 4), (7, 4)])
def test_every_run_is_predicted_in_one_of_four_folds(runs, folds):
    case = case_of()
    readings = fit_problem(
        case, driven(case, loads=np.linspace(40.0, 90.0, runs), slips=3)
    ).readings
    found = _run_folds(readings, 1)
    of_run = [np.unique(found.fold[readings.run[readings.row] == i]) for i in range(runs)]
    assert [len(fold) for fold in of_run] == [1] * runs
    sizes = np.bincount(np.concatenate(of_run))
    assert len(sizes) == folds and sizes.max() - sizes.min() <= 1
    assert found.predicted.tolist() == list(range(folds))
