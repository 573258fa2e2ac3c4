"""Errors of slip and load, and common errors, in tables and model files given to `estimate`."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL, simulated_run

from soilml.cli import main
from soilml.config.case import read_case_of_one_gear
from soilml.config.measurement_noise import (
    Noise,
    checked_sensors,
    common_errors,
    take_bias,
    unestimated_bias,
)
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.gap import workflow
from soilml.gap.checks import DataCheckResult
from soilml.identification.trained_estimator import with_sensors_of
from soilml.io.read_table import read_table
from soilml.io.toml_settings import Settings
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS
from soilml.physics.effects import EFFECTS

BIAS = '[bias]\nslip = 0.0\nload_N = "0 %"\ntorque_Nm = "5 % + 0.1"\nsinkage_m = 0.002\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "exact.toml").write_text(MODEL)
    (tmp_path / "noisy.toml").write_text(MODEL + 'slip = 0.02\nload_N = "2 %"\n')
    (tmp_path / "biased.toml").write_text(MODEL + BIAS)
    return tmp_path


def write_runs(path: Path, run: dict[str, np.ndarray], **columns: float) -> None:
    table = {"slip": run["slip"], "load_N": run["load"], "torque_Nm": run["torque"]}
    table |= {key: np.full(len(run["slip"]), value) for key, value in columns.items()}
    lines = ["run," + ",".join(table)]
    lines += [
        ",".join(["a", *(f"{v:.9g}" for v in row)]) for row in zip(*table.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")


def widths(capsys, *arguments: str) -> np.ndarray:
    """Standard deviations of the single line of `estimate --by run`."""
    assert main(["estimate", *arguments, "--by", "run"]) == 0
    head, row = (line.split(",") for line in capsys.readouterr().out.splitlines()[:2])
    return np.asarray([float(v) for k, v in zip(head, row, strict=True) if k.endswith("_std")])


def test_columns_and_noise_of_slip_and_load_widen_the_estimate(
    folder, capsys, whole_file, wheel_posterior
):
    run, _ = simulated_run(wheel_posterior, 16)
    write_runs(folder / "runs.csv", run)
    write_runs(folder / "noisy.csv", run, slip_std=0.05, load_N_std=3.0)
    file = str(whole_file)
    plain = widths(capsys, file, "runs.csv")
    assert np.prod(widths(capsys, file, "noisy.csv") / plain) > 1.3
    declared = widths(capsys, file, "runs.csv", "--case", "noisy.toml")
    exact = widths(capsys, file, "runs.csv", "--case", "exact.toml")
    assert np.prod(declared / exact) > 1.1


def test_an_estimate_of_single_rows_says_what_it_does_not_use(
    folder, capsys, whole_file, wheel_posterior
):
    write_runs(folder / "noisy.csv", simulated_run(wheel_posterior, 4)[0], slip_std=0.05)
    assert main(["estimate", str(whole_file), "noisy.csv"]) == 0
    said = capsys.readouterr().err
    assert "estimates of single rows do not use slip_std; give --by to have them used" in said


def test_the_errors_that_all_rows_share_are_said(folder, capsys, whole_file, wheel_posterior):
    write_runs(folder / "runs.csv", simulated_run(wheel_posterior, 4)[0])
    assert main(["estimate", str(whole_file), "runs.csv", "--by", "run"]) == 0
    assert "all rows share errors with standard deviations of slip 0.015, load 1 %, torque 3 %" in (
        capsys.readouterr().err
    )


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


def test_commands_that_do_not_use_a_bias_refuse_it(folder, capsys):
    (folder / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.4,60,3.0\n")
    assert main(["advise", "biased.toml", "runs.csv"]) == 2
    assert "bias" in capsys.readouterr().err


def test_a_declared_bias_is_a_checked_sensor_for_gap(folder, monkeypatch):
    """[bias] says of gap's effects what --checked says; the option has the last word."""
    bias = take_bias(Settings(tomllib.loads(BIAS)["bias"], "[bias]", folder))
    sizes = {"torque-gain": 0.05, "torque-offset": 0.1, "sinkage-offset": 0.002}
    assert checked_sensors(bias) == sizes and set(sizes) <= set(EFFECTS)
    (folder / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.4,60,3.0\n")
    given = {}

    def stop(problem, progress):
        given["calibration"] = problem.calibration
        raise InputError("enough")

    monkeypatch.setattr(workflow, "infer", stop)
    monkeypatch.setattr(workflow, "check_readings", lambda *_: DataCheckResult((), (), ()))
    command = ["gap", "biased.toml", "runs.csv", "--out", "found", "--checked", "torque-gain=0.01"]
    assert main(command) == 2
    assert given["calibration"] == sizes | {"torque-gain": 0.01}
    case = replace(read_case_of_one_gear(folder / "biased.toml", with_bias=True), bias=bias)
    with pytest.raises(InputError, match="enough"):
        workflow.gap(case, read_table(folder / "runs.csv"))
    assert given["calibration"] == sizes


def test_a_bias_stays_in_the_model_but_for_errors_that_are_effects_now():
    bias = {"torque_Nm": Noise(0.1, 0.05), "slip": Noise(0.01), "load_N": Noise(share=0.01)}
    assert unestimated_bias(bias, set()) == bias
    left = unestimated_bias(bias, {"torque-gain", "slip-offset", "grousers"})
    assert left == bias | {"torque_Nm": Noise(0.1, 0.0), "slip": Noise()}
