"""The one answer of `estimate` for a run, with errors of the model, and the one without them."""

import csv
import io
from pathlib import Path

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
    assert rows["sound"]["disagrees"] == "0" and "disagree with the exact model" not in said
    assert "errors of the model are included, of a size that follows from the residuals" in said


def test_rows_out_of_range_are_set_aside_and_said(runs, capsys, whole_file):
    rows, said = answers(capsys, str(whole_file), "runs.csv")
    assert rows["far"]["rows_in_range"] == "13" and rows["far"]["in_range"] == "1"
    assert "run far: 3 of 16 rows are out of range; they are set aside" in said


def test_a_run_with_a_fault_of_its_sensor_disagrees(runs, capsys, whole_file):
    text = ["run,slip,load_N,torque_Nm"]
    slip, load, torque = (runs["sound"][name] for name in ("slip", "load", "torque"))
    for name, factor in (("sound", 1.0), ("faulty", np.where(slip > 0.3, 1.6, 1.0))):
        read = np.broadcast_to(factor, slip.shape) * torque
        text += [
            f"{name},{s:.9g},{w:.9g},{t:.9g}" for s, w, t in zip(slip, load, read, strict=True)
        ]
    Path("faulty.csv").write_text("\n".join(text) + "\n")
    rows, said = answers(capsys, str(whole_file), "faulty.csv")
    assert {name: row["disagrees"] for name, row in rows.items()} == {"sound": "0", "faulty": "1"}
    assert "run faulty: " in said
    assert main(["estimate", str(whole_file), "faulty.csv", "--by", "run", "--out", "e.csv"]) == 0
    assert "disagrees" in Path("e.csv").read_text().splitlines()[0]
