"""What a model file is for, and what is said of runs that it does not estimate."""

import pytest
from console import printed


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("wheel", ["radius 0.15 m, width 0.12 m", "without effects",
                   "cohesion 0 to 3 kPa, friction angle 25 to 45 deg"]),
        ("kls1_wheel", ["radius 0.085 m, width 0.08", "without effects",
                        "cohesion 0 to 3 kPa, friction angle 17.19 to 51.57 deg"]),
        ("any_wheel", ["radius 0.04 to 0.5 m", "0 to 1 cohesion_max"]),
    ],
)  # fmt: skip
def test_a_file_alone_is_described_in_one_line(name, said, capsys):
    text = printed(["estimate", name], capsys).out
    assert text.count("\n") == 1 and text.endswith("\n")
    assert f"{name}.onnx: for " in text and all(part in text for part in said)


@pytest.mark.parametrize(
    ("rows", "verdict"),
    [
        ("a,0.2,60,2\na,0.3,60,3\n", "0 of 1 run is estimated; rows disagree with the model: run "),
        ("a,1,60,2\na,-1,60,-2\n", "0 of 1 run is estimated; it is outside what the file was "),
    ],
)
def test_the_verdict_says_why_runs_are_not_estimated(tmp_path, capsys, rows, verdict):
    (tmp_path / "runs.csv").write_text(f"run,slip,load_N,torque_Nm\n{rows}")
    words = ["estimate", "wheel", tmp_path / "runs.csv", "--by", "run"]
    assert printed(words, capsys).out.startswith(verdict)
