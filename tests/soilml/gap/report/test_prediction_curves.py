"""Which readings share a line in the figures of measured and predicted readings."""

import numpy as np
import pytest

from soilml.gap.report.results import ReadingsAndPredictions

pytest.importorskip("matplotlib")

from soilml.gap.report.prediction_curves import prediction_curves, select_runs

SLIP = np.linspace(0.05, 0.6, 5)


def curves(load, run):
    """Five slips at each of the loads, whose runs are named."""
    slip, load, run = np.tile(SLIP, len(load)), np.repeat(load, 5), np.repeat(run, 5)
    return ReadingsAndPredictions(
        channels=("torque_Nm",),
        channel=np.zeros(slip.size, dtype=np.int64),
        run=tuple(run.tolist()),
        slip=slip,
        load=np.asarray(load, dtype=np.float64),
        measured=load * slip,
        std=np.ones(slip.size),
        before=load * slip,
        after=load * slip,
        after_std=np.ones(slip.size),
    )


def test_a_run_at_several_loads_has_a_line_for_each():
    of_one_run = curves(np.arange(40.0, 120.0, 10.0), ["a"] * 8)
    shown = select_runs(of_one_run)
    assert [run.load for run in shown] == [40.0, 60.0, 90.0, 110.0]
    for run in shown:
        np.testing.assert_array_equal(of_one_run.slip[run.rows], SLIP)
    words = prediction_curves(of_one_run, changed=False)
    assert (len(words["runs"]), words["of"], words["several_loads"]) == (4, 8, True)


def test_a_load_that_scatters_from_row_to_row_is_one_line():
    rng = np.random.default_rng(1)
    of_two_runs = curves([60.0, 120.0], ["a", "b"])
    scattered = of_two_runs.load * (1.0 + 0.03 * rng.standard_normal(10))
    of_two_runs = ReadingsAndPredictions(**{**vars(of_two_runs), "load": scattered})
    shown = select_runs(of_two_runs)
    assert [run.run for run in shown] == ["a", "b"]
    assert [int(run.rows.sum()) for run in shown] == [5, 5]
    assert not prediction_curves(of_two_runs, changed=False)["several_loads"]


def test_runs_at_their_own_loads_are_runs():
    words = prediction_curves(curves([60.0, 120.0], ["a", "b"]), changed=False)
    assert [entry["run"] for entry in words["runs"]] == ["a", "b"]
    assert (words["of"], words["several_loads"]) == (2, False)


def test_runs_at_nearly_one_load_have_one_band():
    near = curves(np.asarray([40.0, 40.9, 60.0, 61.1, 40.4]), list("abcde"))
    assert [(run.run, run.load) for run in select_runs(near)] == [("a", 40.0), ("c", 60.0)]
