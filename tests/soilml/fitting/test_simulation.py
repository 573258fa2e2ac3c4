"""Rows that a case predicts, and the names that users import."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Noise, simulate
from soilml.cli.output import save_columns
from soilml.errors import InputError
from soilml.fitting import simulation
from soilml.io.read_table import read_table


def test_rows_are_those_of_the_model_in_blocks_and_say_where_there_is_none(case, monkeypatch):
    slip, load = np.asarray([0.1, 0.3, 0.5]), np.asarray([30.0, 1e7, 90.0])
    whole, counted = simulate(case, slip, load), []
    monkeypatch.setattr(simulation, "BLOCK", 2)
    rows = simulate(case, slip, load, speed=0.05, on_rows=counted.append)
    assert simulate(case, 0.1, 60.0, run="one")["run"].tolist() == ["one"]
    assert counted == [2, 3] and rows["speed_m_s"].tolist() == [0.05] * 3
    assert rows.answered.tolist() == [True, False, True] and np.isnan(rows["torque_Nm"][1])
    for name in ("torque_Nm", "drawbar_pull_N", "sinkage_m", "entry_angle_rad"):
        np.testing.assert_allclose(rows[name], whole[name], rtol=1e-9)


def test_efficiencies_are_of_driving_rows_and_are_passed_over_by_readers(case, tmp_path):
    rows = simulate(case, [-0.2, 0.3], 60.0, with_efficiency=True)
    radius = case.model.gear.radius
    expected = 0.7 * radius * rows["drawbar_pull_N"][1] / rows["torque_Nm"][1]
    assert np.isnan(rows["tractive_efficiency"][0])
    assert rows["tractive_efficiency"][1] == pytest.approx(expected)
    assert np.isnan(rows["pull_efficiency"][0]) and rows["pull_efficiency"][1] < 1.0
    file = tmp_path / "rows.csv"
    save_columns({"run": ["a", "a"], **rows.columns}, file)
    assert "pull_efficiency" not in read_table(file)


def test_noise_is_that_of_the_case_and_its_seed(case):
    case = replace(case, noise={"torque_Nm": Noise(share=0.1)})
    slip = np.full(2000, 0.3)
    exact, noisy = simulate(case, slip, 60.0), simulate(case, slip, 60.0, seed=1)
    relative = noisy["torque_Nm"] / exact["torque_Nm"] - 1.0
    assert np.std(relative) == pytest.approx(0.1, rel=0.05)
    assert abs(np.mean(relative)) < 0.01
    np.testing.assert_array_equal(noisy["sinkage_m"], exact["sinkage_m"])
    again = simulate(case, slip, 60.0, seed=1)
    np.testing.assert_array_equal(again["torque_Nm"], noisy["torque_Nm"])


def test_a_case_of_several_gears_is_refused(case):
    two = replace(case, gears={"a": case.model, "b": case.model})
    with pytest.raises(InputError, match="one gear; this case has a, b"):
        simulate(two, 0.1, 60.0)
