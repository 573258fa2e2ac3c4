"""`soilml example`: each example runs through the command that it names."""

import pytest

from soilml import gap
from soilml.cli import main
from soilml.cli.commands.example import EXAMPLES


@pytest.mark.slow
def test_the_campaign_has_an_effect_that_its_model_lacks(tmp_path, capsys):
    folder = tmp_path / "new" / "campaign"
    assert main(["example", str(folder)]) == 0
    assert f"Next: soilml gap {folder}/model.toml" in capsys.readouterr().out
    found = gap(folder / "model.toml", folder / "runs.csv")
    assert found.status == "named" and [effect.name for effect in found.effects] == ["slip-sinkage"]


@pytest.mark.slow
def test_the_log_is_imported_by_the_map_that_is_guessed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["example", "log", "."]) == 0
    assert main(["import", "--init", "rig.csv", "--out", "map.toml"]) == 0
    assert main(["import", "rig.csv", "--map", "map.toml", "--out", "runs.csv"]) == 0
    capsys.readouterr()
    assert main(["identify", "model.toml", "runs.csv", "--method", "nonlinear"]) == 0
    assert "friction_angle" in capsys.readouterr().out


@pytest.mark.slow
def test_the_rover_answers_for_slopes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["example", "rover", "."]) == 0
    assert main(["pull", "rover.toml", "runs.csv", "--slope", "0,10", "--format", "table"]) == 0
    assert "slope_deg" in capsys.readouterr().out


def test_examples_replace_nothing_and_name_each_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text("mine")
    assert main(["example", "."]) == 2
    assert "model.toml exists; give another folder" in capsys.readouterr().err
    assert (tmp_path / "model.toml").read_text() == "mine"
    assert main(["example", "campain", "x"]) == 2
    said = capsys.readouterr().err
    assert "did you mean 'campaign'" in said and all(name in said for name in EXAMPLES)
