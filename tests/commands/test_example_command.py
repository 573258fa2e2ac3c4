"""`soilml example`: each example runs through the command that it names."""

import pytest
from console import refused, rows_of

from soilml import gap
from soilml.cli import main
from soilml.cli.commands.example import NEXT
from soilml.rover_design import read_study


@pytest.mark.slow
def test_the_campaign_has_an_effect_that_its_model_lacks(tmp_path, capsys):
    folder = tmp_path / "new" / "campaign"
    assert main(["example", str(folder)]) == 0
    assert f"Next: soilml gap {folder}/model.toml" in capsys.readouterr().out
    found = gap(folder / "model.toml", folder / "runs.csv")
    assert found.status == "named" and [effect.name for effect in found.effects] == ["slip-sinkage"]


@pytest.mark.slow
def test_the_log_is_imported_by_the_map_that_is_guessed(workplace, capsys):
    assert main(["example", "log", "."]) == 0
    assert main(["import", "--init", "rig.csv", "--out", "map.toml"]) == 0
    assert main(["import", "rig.csv", "--map", "map.toml", "--out", "runs.csv"]) == 0
    capsys.readouterr()
    assert main(["identify", "model.toml", "runs.csv", "--method", "nonlinear"]) == 0
    assert "friction_angle" in capsys.readouterr().out


@pytest.mark.slow
def test_the_rover_answers_for_slopes_as_a_whole(workplace, capsys):
    assert main(["example", "rover", "."]) == 0
    capsys.readouterr()
    words = ["pull", "rover.toml", "runs.csv", "--slope"]
    assert main([*words, "0,8", "-v", "--out", "rover.csv", "--picture", "rover.png"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("The rover climbs ") and "slope, deg" in said and "rear-left" in said
    rows = rows_of((workplace / "rover.csv").read_text())
    assert [round(float(row["slope_rad"]), 3) for row in rows] == [0.0, 0.14]
    assert float(rows[1]["slip"]) > float(rows[0]["slip"])
    assert (workplace / "rover.png").read_bytes().startswith(b"\x89PNG")
    refused([*words, "58"], capsys, "leaves the ground on a slope of 58 deg")


def test_examples_replace_nothing_and_name_each_other(workplace, capsys):
    assert main(["example", "design", "new"]) == 0
    assert read_study(workplace / "new/rover.toml").goal.least == "width"
    (workplace / "model.toml").write_text("mine")
    refused(["example", "."], capsys, "model.toml exists; give another folder", workplace)
    assert main(["example", "campain", "x"]) == 2
    said = capsys.readouterr().err
    assert "did you mean 'campaign'" in said and all(name in said for name in NEXT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("sensor-wheel", "3 of 3 other runs"),
        ("climb", "The rover climbs 13."),
        ("wheel-leg", "SSC-1"),
        ("track", "The model fits these rows"),
    ],
)
def test_the_chain_of_a_paper_runs_on_its_example(name, said, workplace, capsys):
    """The command that is printed, with its picture where it draws one; the truth is found."""
    assert main(["example", name, "."]) == 0
    command = capsys.readouterr().out.partition("Next: soilml ")[2].replace("./", "").split()
    picture = ["--picture", "x.png"]
    assert main([*command, *picture, "--format", "table"]) == 0
    assert said in capsys.readouterr().out
    assert (workplace / "x.png").read_bytes().startswith(b"\x89PNG")


def test_a_log_of_a_track_is_refused_in_one_line(workplace, capsys):
    assert main(["example", "track", "."]) == 0
    command = ["paper", "track", "model.toml", "log.csv", "--mass", "130"]
    rows = (workplace / "log.csv").read_text().splitlines()
    (workplace / "short.csv").write_text("\n".join(rows[:60]) + "\n")
    for words, expected in (
        (command, "give their spacing"),
        ([*command, "--spacing", "0.6", "--grousers", "1,2"], "needed are pitch, tip, f_g and j_k"),
        ([*command[:3], "short.csv", *command[4:], "--spacing", "0.6"], "run pull_1: signal has"),
    ):
        refused([*words, "--out", "x.csv"], capsys, expected, workplace)
