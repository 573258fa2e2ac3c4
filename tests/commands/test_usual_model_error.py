"""The two answers of `estimate` for a run: the model is right, and it has its usual errors."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL, simulated_run

from soilml.cli import main
from soilml.onboard.estimator import Estimator


@pytest.fixture
def runs(tmp_path, monkeypatch, wheel_posterior):
    """A sound run, and one whose torque jumps by a quarter: no soil explains it."""
    monkeypatch.chdir(tmp_path)
    sound, _ = simulated_run(wheel_posterior, 16)
    lines = ["run,slip,load_N,torque_Nm"]
    for name, bend in (("sound", 0.0), ("bent", 0.25)):
        torque = sound["torque"] * (1.0 + bend * np.where(np.arange(16) % 2, 1.0, -1.0))
        columns = (sound["slip"], sound["load"], torque)
        lines += [
            ",".join([name, *(f"{v:.9g}" for v in row)]) for row in zip(*columns, strict=True)
        ]
    (tmp_path / "runs.csv").write_text("\n".join(lines) + "\n")
    return {"sound": sound}


def answers(capsys, *arguments: str) -> tuple[dict[str, dict[str, str]], str]:
    """Rows by run, and what was said."""
    assert main(["estimate", *arguments, "--by", "run"]) == 0
    captured = capsys.readouterr()
    table = csv.DictReader(io.StringIO(captured.out))
    return {row["run"]: row for row in table}, captured.err


def test_a_run_has_both_answers(runs, capsys, whole_file):
    rows, said = answers(capsys, str(whole_file), "runs.csv")
    usual = Estimator.load(whole_file).on(model_error=1.0).run(**runs["sound"])
    row = rows["sound"]
    assert float(row["cohesion_Pa_usual"]) == pytest.approx(usual["cohesion"][0], rel=1e-4)
    assert float(row["cohesion_Pa_usual_std"]) == pytest.approx(usual["cohesion"][1], rel=1e-4)
    assert float(row["shear_modulus_m_usual_p95"]) == pytest.approx(usual.high[2], rel=1e-4)
    assert float(row["cohesion_Pa_usual_std"]) > 1.2 * float(row["cohesion_Pa_std"])
    assert row["in_range"] == row["in_range_usual"] == "1"
    assert (
        "use the intervals that include model errors (_usual), unless this model was verified"
        in said
    )
    assert "run bent: the model taken as exact does not explain the rows, nor does it" in said


def test_a_declared_discrepancy_takes_the_place_of_the_second_answer(runs, capsys, whole_file):
    Path("own.toml").write_text(MODEL + '[discrepancy]\ntorque_Nm = "2 %"\n')
    rows, said = answers(capsys, str(whole_file), "runs.csv", "--case", "own.toml")
    assert not [key for key in rows["sound"] if "usual" in key] and "two intervals" not in said
