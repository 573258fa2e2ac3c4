"""What the README shows works as shown."""

import re
from pathlib import Path

import numpy as np
import pytest

from soilml import read_case, read_table
from soilml.cli.main import ORDER, main
from soilml.io.read_table import RUNS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_python_lines_run(monkeypatch):
    monkeypatch.chdir(ROOT)
    lines, _ = blocks("python")
    names: dict = {}
    exec(lines, names)
    assert names["force"].torque.shape == (50,)
    assert names["one"].mean.shape == names["all_"].mean.shape == (3,)
    assert bool(names["one"].in_range) and bool(names["all_"].in_range)


def test_the_model_file_is_valid(tmp_path):
    model = next(b for b in blocks("toml") if "[gear]" in b)
    (tmp_path / "model.toml").write_text(model)
    case = read_case(tmp_path / "model.toml")
    assert case.soil.friction_angle == 0.60
    assert set(case.prior) == {"cohesion", "friction_angle", "shear_modulus", "slip-sinkage.n1"}


def test_the_recipe_and_the_spec_can_be_generated_and_trained(tmp_path, monkeypatch):
    model = next(b for b in blocks("toml") if "[gear]" in b)
    extra = next(b for b in blocks("toml") if "[operating]" in b)
    (tmp_path / "recipe.toml").write_text(f"rows = 60000\nseed = 1\n{model}{extra}")
    spec = next(b for b in blocks("toml") if "[[regressor]]" in b)
    (tmp_path / "spec.toml").write_text(spec)
    monkeypatch.chdir(tmp_path)
    assert main(["generate", "recipe.toml", "data.parquet", "--rows", "3000"]) == 0
    assert main(["train", "spec.toml", "data.parquet", "model.onnx"]) == 0


def test_the_table_of_runs_is_valid(tmp_path):
    text = blocks("csv")[0]
    (tmp_path / "runs.csv").write_text(text)
    table = read_table(tmp_path / "runs.csv", RUNS)
    assert np.isnan(table["drawbar_pull_N"]).all()


def test_an_effect_of_ones_own_pulls_back(tmp_path, capsys):
    _, effect = blocks("python")
    (tmp_path / "mine.py").write_text(effect)
    model = next(b for b in blocks("toml") if "[gear]" in b)
    (tmp_path / "model.toml").write_text(f'{model}[[effect]]\nname = "cable-drag"\nforce = 2.0\n')
    command = ["simulate", str(tmp_path / "model.toml"), "--slip", "0.3", "--load", "60"]
    assert main(command) == 2
    assert "cable-drag" in capsys.readouterr().err
    assert main([*command, "--effects", str(tmp_path / "mine.py")]) == 0
    dragged = float(capsys.readouterr().out.splitlines()[1].split(",")[3])
    (tmp_path / "model.toml").write_text(model)
    assert main(command) == 0
    free = float(capsys.readouterr().out.splitlines()[1].split(",")[3])
    assert free - dragged == pytest.approx(2.0)


@pytest.mark.parametrize("command", ORDER)
def test_every_command_is_on_the_screen(command):
    assert f"\nsoilml {command} " in README
