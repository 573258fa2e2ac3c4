"""`soilml bevameter` at the command line."""

import json

import pytest
from conftest import MODEL
from console import printed, refused

from soilml import read_case
from soilml.cli import main

PLATES = "test,plate_radius_m,sinkage_m,load_N\n" + "".join(
    f"{name},{r},{z},{(2e3 / r + 6e5) * z * 3.14159 * r**2}\n"
    for name, r in (("small", 0.05), ("large", 0.08))
    for z in (0.0, 0.01, 0.02, 0.03, 0.04)
)
SHEAR = "test,normal_stress_Pa,shear_displacement_m,shear_stress_Pa\n" + "".join(
    f"at_{sigma},{sigma},{j},{(500 + 0.6 * sigma) * share}\n"
    for sigma in (5000, 10000, 20000)
    for j, share in ((0.01, 0.632), (0.02, 0.865), (0.05, 0.993), ("", 1.0))
)


@pytest.fixture
def tables(workplace):
    (workplace / "plates.csv").write_text(PLATES)
    (workplace / "shear.csv").write_text(SHEAR)
    (workplace / "model.toml").write_text(MODEL)
    return workplace


@pytest.mark.slow
def test_both_tables_in_either_order_give_a_model_file_that_identify_takes(tables, capsys):
    words = ["bevameter", "shear.csv", "plates.csv", "--model", "model.toml"]
    assert main([*words, "--out", "soil.json"]) == 0
    assert main([*words, "--out", "soil.toml", "--picture", "soil.png"]) == 0
    said = capsys.readouterr().out
    assert "95 % elsewhere" in said and "! no plate test was repeated" in said
    case = read_case("soil.toml")
    assert case.soil.cohesion == pytest.approx(500.0, rel=0.1)
    assert case.soil.n == pytest.approx(1.0, rel=0.02)
    assert set(case.prior) == {"cohesion", "friction_angle", "shear_modulus", "kphi", "n"}
    assert case.model.gear.width == 0.12 and "torque_Nm" in case.noise
    written = json.loads((tables / "soil.json").read_text())
    assert written["estimates"]["kc"]["unit"] == "N/m^(n+1)"
    assert [t["test"] for t in written["plate_tests"]] == ["small", "large"]
    assert (tables / "soil.png").read_bytes()[:4] == b"\x89PNG"
    words = ["simulate", "soil.toml", "--slip", "0.1,0.3", "--load", "60", "--format", "csv"]
    runs = printed(words, capsys).out.replace("slip,", "run,slip,", 1).replace("\n0.", "\na,0.")
    (tables / "runs.csv").write_text(runs)
    assert main(["identify", "soil.toml", "runs.csv", "--method", "nonlinear"]) == 0


def test_bad_shear_tables_end_with_one_line(tables, capsys):
    for old, new, said in (
        ("normal_stress_Pa", "normal_stress_kPa", "name the column normal_stress_Pa"),
        ("normal_stress_Pa", "time_s", "normal_stress_Pa is missing"),
        (",10000,", ",-10000,", "a normal stress above zero"),
    ):
        (tables / "bad.csv").write_text(SHEAR.replace(old, new))
        refused(["bevameter", "bad.csv"], capsys, said)
    refused(["bevameter", "shear.csv", "shear.csv"], capsys, "given twice")
    (tables / "runs.csv").write_text("test,slip\na,0.1\n")
    refused(["bevameter", "runs.csv"], capsys, "no table of tests")
