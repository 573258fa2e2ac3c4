"""Errors of slip and load, and common errors, in tables and model files given to `estimate`."""

from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL, simulated_run
from console import rows_printed

from soilml.config.case import read_case_of_one_gear
from soilml.config.measurement_noise import common_errors
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.identification.trained_estimator import with_sensors_of
from soilml.io.text_tables import csv_text
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS

BIAS = '[bias]\nslip = 0.0\nload_N = "0 %"\ntorque_Nm = "5 % + 0.1"\nsinkage_m = 0.002\n'


@pytest.fixture
def folder(workplace):
    (workplace / "exact.toml").write_text(MODEL)
    (workplace / "noisy.toml").write_text(MODEL + 'slip = 0.02\nload_N = "2 %"\n')
    (workplace / "biased.toml").write_text(MODEL + BIAS)
    return workplace


def write_runs(path: Path, run: dict[str, np.ndarray], **columns: float) -> None:
    table = {"slip": run["slip"], "load_N": run["load"], "torque_Nm": run["torque"]}
    table |= {key: np.full(len(run["slip"]), value) for key, value in columns.items()}
    path.write_text(csv_text({"run": ["a"] * len(run["slip"]), **table}))


def widths(capsys, *arguments: str) -> np.ndarray:
    """Standard deviations of the single line of `estimate --by run`."""
    (row,) = rows_printed(["estimate", *arguments, "--by", "run"], capsys)
    return np.asarray([float(v) for k, v in row.items() if k.endswith("_std")])


def test_columns_and_noise_of_slip_and_load_widen_the_estimate(
    folder, capsys, whole_file, wheel_posterior
):
    run, _ = simulated_run(wheel_posterior, 16)
    write_runs(folder / "runs.csv", run)
    write_runs(folder / "noisy.csv", run, slip_std=0.05, load_N_std=3.0)
    file = str(whole_file)
    plain = widths(capsys, file, "runs.csv")
    assert np.prod(widths(capsys, file, "noisy.csv") / plain) > 1.3
    declared = widths(capsys, file, "runs.csv", "--model", "noisy.toml")
    exact = widths(capsys, file, "runs.csv", "--model", "exact.toml")
    assert np.prod(declared / exact) > 1.1


def test_the_bias_of_a_case_replaces_the_usual_one(folder, whole_file):
    case = read_case_of_one_gear(folder / "biased.toml", with_bias=True)
    found = with_sensors_of(Estimator.load(whole_file), case).sets
    assert found.common_errors["slip_bias"] == found.common_errors["load_gain"] == 0.0
    assert found.common_errors["torque_gain"] == 0.05
    assert found.noise["torque_bias"] == (0.1, 0.0)
    assert found.common_errors["sinkage_bias"] == 0.002
    assert set(common_errors(case.bias)) - {"torque_bias"} <= set(COMMON_ERROR_INPUTS)
    (folder / "again.toml").write_text(case_as_toml(case))
    assert read_case_of_one_gear(folder / "again.toml", with_bias=True).bias == case.bias


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('slip = "2 %"', "slip has a bias in its own unit"),
        ("load_N = 2.0", "load_N has a relative bias"),
        ("torque_Nm = -0.1", "finite number, zero or more"),
        ("speed_m_s = 0.1", "speed_m_s"),
    ],
)
def test_a_bias_that_cannot_be_is_refused(folder, line, said):
    (folder / "wrong.toml").write_text(MODEL + f"[bias]\n{line}\n")
    with pytest.raises(InputError, match=said):
        read_case_of_one_gear(folder / "wrong.toml", with_bias=True)
