"""What a model file is for, and whether it is for the wheel of a case and of a table."""

from pathlib import Path

import pytest
from conftest import MODEL

from soilml.cli import main

EXPORTED = Path(__file__).parents[2] / "exported"
WHEEL, ANY_WHEEL = (str(EXPORTED / f"{name}.onnx") for name in ("wheel", "any_wheel"))
KLS1 = str(EXPORTED / "kls1_wheel.onnx")
RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.4,60,3.0\n"
SLIP_SINKAGE = '[[effect]]\nname = "slip-sinkage"\nn1 = 0.4\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "effect.toml").write_text(MODEL + SLIP_SINKAGE)
    (tmp_path / "small.toml").write_text(MODEL.replace("radius = 0.15", "radius = 0.12"))
    (tmp_path / "runs.csv").write_text(RUNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one_line(text):
    assert text.count("\n") == 1 and text.endswith("\n"), text
    return text


def test_a_file_alone_is_described_in_one_line(folder, capsys):
    for file, size in (
        (WHEEL, "radius 0.15 m, width 0.12 m"),
        (KLS1, "radius 0.085 m, width 0.08"),
    ):
        assert main(["estimate", file]) == 0
        said = one_line(capsys.readouterr().out)
        assert f"{file}: for a wheel of {size}" in said and "without effects" in said
    assert "cohesion 0 to 3 kPa, friction angle 17.19 to 51.57 deg" in said
    assert main(["estimate", ANY_WHEEL]) == 0
    said = one_line(capsys.readouterr().out)
    assert "radius 0.04 to 0.5 m" in said and "0 to 1 cohesion_max" in said


@pytest.mark.parametrize(
    ("rows", "verdict"),
    [
        ("a,0.2,60,2\na,0.3,60,3\n", "0 of 1 run is estimated; rows disagree with the model: run "),
        ("a,1,60,2\na,-1,60,-2\n", "0 of 1 run is estimated; it is outside what the file was "),
    ],
)
def test_the_verdict_says_why_runs_are_not_estimated(folder, capsys, rows, verdict):
    (folder / "runs.csv").write_text(f"run,slip,load_N,torque_Nm\n{rows}")
    assert main(["estimate", WHEEL, "runs.csv", "--by", "run"]) == 0
    assert capsys.readouterr().out.startswith(verdict)
