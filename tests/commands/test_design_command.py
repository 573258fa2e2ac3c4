"""`soilml plan wheels`: JSON, tables, picture and page; faults are one line and status 2."""

import json

import pytest
from console import printed, refused

STUDY = """
[rover]
mass = 12.0
wheels = 4
wheelbase = 0.40
centre_of_mass = [0.0, 0.18]
gravity = "earth"

[wheel]
radius = 0.09
width = [0.05, 0.12]
lug_height = 0.01

[soil]
name = "ding2015/hit_lss1"
[soil.prior]
friction_angle = [0.5, 0.7]

[goal]
slope = "3 deg"
risk = 0.2
"""
FEW = ["--designs", "6", "--draws", "50"]


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "rover.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.slow
def test_the_answer_is_json_in_a_pipe(study, capsys):
    changed = ["--gravity", "mars", "--risk", "0.2", "--soil", "ding2015/hit_lss1"]
    words = ["plan", "wheels", study, *FEW, *changed, "--format", "json"]
    content = json.loads(printed(words, capsys).out)
    assert content["goal"]["risk"] == 0.2 and content["gravity_m_s2"] < 4.0
    assert content["goal"]["slope_rad"] == pytest.approx(0.05236, abs=1e-5)
    assert content["soils"] == ["ding2015/hit_lss1"]
    assert len(content["designs"]["width"]) == len(content["designs"]["probability"]) == 12
    best = content["best"]
    assert best["margin_N_p05"] < best["margin_N"] < best["margin_N_p95"]
    assert 0.0 < best["probability"] <= best["probability_climbed"] <= 1.0
    assert "friction_angle" in content["variance_shares"]
    assert content["tests"][0]["share"] > 0.1


@pytest.mark.slow
def test_the_soil_of_measured_rows(study, tmp_path, model_file, capsys):
    runs = "run,slip,load_N,torque_Nm\na,0.1,20,0.6\na,0.2,30,1.4\na,0.4,30,2.0\n"
    (tmp_path / "runs.csv").write_text(runs)
    start, end = STUDY.index("[soil]"), STUDY.index("[goal]")
    text = f'[soil]\nmodel = "{model_file.name}"\nruns = "runs.csv"\n\n'
    study.write_text(STUDY[:start] + text + STUDY[end:])
    content = json.loads(printed(["plan", "wheels", study, *FEW, "--format", "json"], capsys).out)
    assert any(one["code"] == "errors-before-rows" for one in content["warnings"])
    assert content["soils"] == [str(tmp_path / model_file.name), str(tmp_path / "runs.csv")]


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        (("mass = 12.0\n", ""), [], "mass is missing; needed is a number in kg"),
        (("0.18]", "9.0]"), [], "of axle 1 leaves the ground on a slope of 3 deg"),
        (("", ""), ["--slope", "70"], "needed is 0 to 60 degrees"),
        (("", ""), ["--gravity", "pluto"], "gravity is 'pluto'"),
        (("", ""), ["--soil", "moon"], "no soil 'moon'"),
        (("", ""), ["--draws", "3"], "needed is a whole number from 50 to 20000"),
    ],
)
def test_bad_input_is_one_line_and_status_two(study, change, options, said, capsys):
    study.write_text(STUDY.replace(*change))
    refused(["plan", "wheels", study, "--designs", "4", *options], capsys, said)
