"""`soilml adapt`: errors of one line, a refusal that is a result, and the whole chain."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL
from console import refused

import soilml
from soilml import SlipSinkage, read_case, simulate
from soilml.cli import main
from soilml.io.text_tables import csv_text
from training.adaptation import workflow
from training.adaptation.supported_errors import CHECKED
from training.adaptation.workflow import GAP_FILES
from training.commands.adapt import FILES
from training.set_posterior import validation
from training.set_posterior.error_scales import ErrorScales

#: The packaged spec with a response that is learned in seconds.
SMALL_SPEC = """\
features = ["slip", "torque/load", "load"]
targets = ["cohesion", "friction_angle", "shear_modulus"]
[[regressor]]
type = "linear"
[set_posterior]
designs = 512
hidden = 24
epochs = 40
"""


@pytest.fixture
def small_training(tmp_path, monkeypatch):
    """Files are trained by the small spec, and calibrated on a tenth of the sets of few sizes."""
    (tmp_path / "small.toml").write_text(SMALL_SPEC)
    monkeypatch.setattr(workflow, "SPEC", str(tmp_path / "small.toml"))
    monkeypatch.setattr(validation, "SET_SIZES", (1, 4, 16))
    for name in ("LIMIT_SETS", "FIGURE_SETS", "LEAST_NEIGHBOURS"):
        monkeypatch.setattr(validation, name, getattr(validation, name) // 10)


def write_log(folder, *effects, loads=(40.0, 60.0, 80.0, 100.0, 120.0, 50.0), priors=""):
    """A model file and runs of a wheel with effects that the model lacks."""
    text = THREE_CHANNEL_MODEL.replace("[noise]", f"{priors}[noise]")
    (folder / "model.toml").write_text(text)
    case = read_case(folder / "model.toml")
    world = replace(case, model=replace(case.model, effects=effects))
    slip = np.tile(np.linspace(0.08, 0.6, 12), len(loads))
    names = np.repeat([f"r{i}" for i in range(len(loads))], 12)
    table = simulate(world, slip, np.repeat(loads, 12), run=names, seed=4)
    columns = {k: v for k, v in table.columns.items() if k not in ("entry_angle_rad", "status")}
    (folder / "runs.csv").write_text(csv_text(columns))
    return ["adapt", str(folder / "model.toml"), str(folder / "runs.csv")]


def test_errors_are_one_line_and_leave_nothing(tmp_path, capsys):
    words = [*write_log(tmp_path), "--out", str(tmp_path / "out")]
    missing = str(tmp_path / "none.onnx")
    refused([*words, "--against", missing], capsys, "none.onnx")
    model = tmp_path / "model.toml"
    model.write_text(model.read_text().replace("[gear]", "[gears.one]"))
    refused(words, capsys, "several gears (one)")
    refused([*words, "--rows", "10"], capsys, "from 2000")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_without_a_gap_the_old_file_stays_and_that_is_a_result(tmp_path, capsys):
    out = tmp_path / "out"
    words = [*write_log(tmp_path), "--out", str(out)]
    out.mkdir()
    (out / "adapted.onnx").write_text("of an earlier call")
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("The old file stays: ")
    content = json.loads((out / "adapt.json").read_text())
    assert content["status"] == "not-supported" and content["gap"]["status"] == "no-gap"
    assert [r["code"] for r in content["remarks"]] == ["gap-no-gap"]
    assert "The old file stays" in (out / "report.html").read_text()
    assert not (out / "adapted.onnx").exists() and not list(out.glob("*.parquet"))


@pytest.mark.slow
def test_the_chain_from_a_hidden_effect_to_a_better_file(tmp_path, capsys, small_training):
    """A wheel that digs itself in, heavy loads, and priors that reach to soft soils."""
    out = tmp_path / "out"
    soft = 'kphi = { range = [2e5, 3e6], scale = "log" }\nn = [0.7, 1.3]\n'
    loads = (60.0, 120.0, 200.0, 90.0, 150.0, 75.0)
    words = [*write_log(tmp_path, SlipSinkage(n1=0.5), loads=loads, priors=soft)]
    words += ["--out", str(out), "--rows", "2000", "--against", "wheel"]
    assert main(words) == 0
    shown = capsys.readouterr().out
    content = json.loads((out / "adapt.json").read_text())
    assert content["status"] == "adapted" and content["effects"] == ["slip-sinkage"]
    assert content["judgement"]["error_ratio"] < 0.6
    written = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert written <= {*FILES, *GAP_FILES}
    assert shown.splitlines()[0] == content["sentence"]
    torque = content["judgement"]["channels"]["torque_Nm"]
    assert torque["after"]["error"] < torque["before"]["error"]
    assert all((out / name).is_file() for name in content["files"])
    assert not (out / "before.onnx").exists()
    assert "slip-sinkage" in (out / "adapted.toml").read_text()
    file = soilml.Estimator.load(out / "adapted.onnx")
    sets = json.loads(file.metadata["set"])
    scales = ErrorScales.of_list(sets["model_error_scales"])
    assert scales.sizes[0].tolist() == list(CHECKED[1:]) and scales.probabilities[0] > 0.5
    assert "model-errors" in [remark["code"] for remark in content["remarks"]]
    assert f"| {CHECKED.bearing} |" in (out / "adapted.md").read_text()
    assert file.names == ("cohesion", "friction_angle", "shear_modulus")
    assert 0.9 < sets["carried"] < 1.0 and sets["load"] == [50.0, 240.0]
    share = f"carry the wheel in {sets['carried']:.2%} of the operating conditions"
    assert share in (out / "adapted.md").read_text()
