"""Measured tests, where `SOILML_DATA` names a folder that holds them."""

import csv
import importlib.util
import json
import os
from pathlib import Path

import pytest
from remarked import remarked

from soilml.cli import main

DATA = os.environ.get("SOILML_DATA", "")
KLS1 = Path(DATA) / "kls1_rashid1" / "single_wheel_tests.csv"
ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.skipif(
    not (DATA and KLS1.is_file()), reason="SOILML_DATA does not name a folder with measured tests"
)
SMOOTH = ["--where", "run=kls1_smooth_w59"]


def test_identification_says_what_five_points_at_one_load_can_tell(capsys):
    model = str(ROOT / "examples/kls1/model.toml")
    assert (
        main(["identify", model, str(KLS1), *SMOOTH, "--method", "nonlinear", "--format", "json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert found["rows_used"] == 5
    assert ("not-identified", ["cohesion"]) in [(w["code"], w["about"]) for w in found["warnings"]]
    friction = found["parameters"]["friction_angle"]
    assert friction["value"] + 1.645 * friction["std"] < 0.7086  # below direct shear: smooth rim


def test_estimates_of_five_points_at_one_load_stay_with_the_prior(capsys):
    model = str(ROOT / "exported/kls1_wheel.onnx")
    assert main(["estimate", model, str(KLS1), *SMOOTH, "--by", "run", "--format", "csv"]) == 0
    captured = capsys.readouterr()
    assert captured.out.count("\n") == 2
    assert "mostly the prior" in captured.err


def test_the_gap_workflow_on_published_tests(tmp_path, monkeypatch):
    """Wheels at one load are not named; what makes sinkage grow with slip is told."""
    spec = importlib.util.spec_from_file_location("real", ROOT / "examples" / "gap" / "real.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.chdir(tmp_path)
    module.run(["--only", "ding2011_smooth", "ding2011_lugged"])

    def said(name, priors):
        return json.loads(
            (tmp_path / "demo/gap/real" / name / priors / "report/gap.json").read_text()
        )

    for name, priors in (
        ("ding2011_smooth", "init"),
        ("ding2011_smooth", "wide"),
        ("ding2011_lugged", "tight"),
        ("ding2011_lugged", "init"),
        ("ding2011_lugged", "wide"),
    ):
        found = said(name, priors)
        assert found["status"] == "suspected" and found["effects"] == []
        assert found["suspects"][0]["effects"] == ["slip-sinkage"], (name, priors)
        assert found["gap"]["train"]["after"] < 0.2 * found["gap"]["train"]["before"]
        assert any(reason["code"] == "one-load" for reason in found["reasons"])


def test_the_continuous_law_of_braking_explains_driving_and_braking_far_better(tmp_path, capsys):
    """A smooth wheel, slips -0.7 to 0.9, soil alone: it leaves a third of the misfit."""
    table = Path(DATA) / "cmu_smooth_wheel" / "smooth_wheel_trials.csv"
    with table.open() as lines:
        rows = [row for row in csv.DictReader(lines) if float(row["slip_angle_rad"]) == 0.0]
    columns = ("slip", "load_N", "drawbar_pull_N", "sinkage_m")
    kept = [",".join(row[c] for c in columns) for row in rows if float(row["slip"]) > -1.0]
    runs = tmp_path / "runs.csv"
    runs.write_text("\n".join(["run,torque_Nm," + ",".join(columns), *(f"a,,{k}" for k in kept)]))
    text = (ROOT / "examples/gap/cmu.toml").read_text()
    misfit = []
    for law in ("displacement-sign", "slip-sign"):
        model = tmp_path / f"{law}.toml"
        model.write_text(text.replace("[gear]", f'[gear]\nbraking = "{law}"'))
        assert (
            main(["identify", str(model), str(runs), "--method", "nonlinear", "--format", "json"])
            == 0
        )
        misfit.append(json.loads(capsys.readouterr().out)["misfit"])
    assert misfit[0] < 0.4 * misfit[1]


def test_plate_and_shear_tests_contain_their_known_soil(tmp_path, monkeypatch):
    """The simulated bevameter has known parameters; the sand a friction angle by triaxial tests."""
    path = ROOT / "examples" / "bevameter" / "real.py"
    spec = importlib.util.spec_from_file_location("bevameter_real", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.chdir(tmp_path)
    module.run()
    made = tmp_path / "demo/bevameter"
    words = ["bevameter", str(made / "crm_plates.csv"), str(made / "crm_ring.csv")]
    assert main([*words, "--out", str(tmp_path / "crm.json")]) == 0
    found = json.loads((tmp_path / "crm.json").read_text())
    known = {"kphi": 2.2e6, "kc": -1.1e5, "n": 1.2}
    known |= {"cohesion": 2495.0, "friction_angle": 0.4189, "shear_modulus": 0.003}
    for name, value in known.items():
        low, high = found["estimates"][name]["another_place_95"]
        assert low <= value <= high, name
    assert remarked(found["remarks"], "failure line is curved")
    words = ["bevameter", str(made / "cullinan_shear.csv")]
    assert main([*words, "--out", str(tmp_path / "sand.json")]) == 0
    found = json.loads((tmp_path / "sand.json").read_text())
    low, high = found["estimates"]["shear_strength"]["another_place_95"]
    assert low <= 93e3 * 0.637 <= high  # tan 32.5 degrees, without cohesion
    assert remarked(found["remarks"], "not identifiable")
