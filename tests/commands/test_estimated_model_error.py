"""The one answer of `estimate` for a run, with errors of the model, and the one without them."""

import csv
import io

import numpy as np
import pytest
from conftest import simulated_run

from soilml.cli import main
from soilml.onboard.estimator import Estimator


@pytest.fixture
def runs(tmp_path, monkeypatch, wheel_posterior):
    """A sound run, and one with three rows of a load far out of range."""
    monkeypatch.chdir(tmp_path)
    sound, _ = simulated_run(wheel_posterior, 16)
    lines = ["run,slip,load_N,torque_Nm"]
    for name, far in (("sound", 0), ("far", 3)):
        load = np.where(np.arange(16) < far, 5000.0, sound["load"])
        columns = (sound["slip"], load, sound["torque"])
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


def test_a_run_has_one_answer_with_errors_of_the_model(runs, capsys, whole_file):
    rows, said = answers(capsys, str(whole_file), "runs.csv")
    own = Estimator.load(whole_file).run(**runs["sound"])
    assert float(rows["sound"]["cohesion_Pa"]) == pytest.approx(own["cohesion"][0], rel=1e-3)
    assert float(rows["sound"]["shear_modulus_m_p95"]) == pytest.approx(own.high[2], rel=1e-3)
    assert not [key for key in rows["sound"] if "usual" in key]
    assert "errors of the model are included, of a size that follows from the residuals" in said


def test_rows_out_of_range_are_set_aside_and_said(runs, capsys, whole_file):
    rows, said = answers(capsys, str(whole_file), "runs.csv")
    assert rows["far"]["rows_in_range"] == "13" and rows["far"]["in_range"] == "1"
    assert "run far: 3 of 16 rows are out of range; they are set aside" in said
