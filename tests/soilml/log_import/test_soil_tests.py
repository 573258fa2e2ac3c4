"""Plate and shear tests as laboratories write them."""

import json

import numpy as np
import pytest
from conftest import MODEL

from soilml import read_case
from soilml.cli import main
from soilml.errors import InputError
from soilml.log_import.soil_tests import read_soil_tests


def written(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "tests.csv"
    path.write_text(text, encoding=encoding)
    return path


@pytest.mark.parametrize(
    ("header", "rows", "expected"),
    [
        ("Test,b [mm],z [mm],p [kPa]", ["A,50,2.5,12", "A,50,5,20", "B,75,2.5,11"],
         {"plate_radius_m": 0.05, "sinkage_m": 0.0025, "pressure_Pa": 12e3}),
        ("probe;Durchmesser (cm);Verschiebung (mm);Kraft (kgf)",
         ["A;10;2,5;1,2", "A;10;5,0;2,0", "B;15;2,5;1,1"],
         {"plate_radius_m": 0.05, "sinkage_m": 0.0025, "load_N": 1.2 * 9.80665}),
        ("sample\tsigma (psi)\tdisplacement (in)\ttau (psi)",
         ["1\t2\t0.1\t0.5", "1\t2\t0.2\t0.8", "2\t4\t0.1\t0.9"],
         {"normal_stress_Pa": 13789.514, "shear_displacement_m": 0.00254,
          "shear_stress_Pa": 3447.3786}),
        ("no,inner radius [mm],outer radius [mm],angle [deg],torque [N cm],load [N]",
         ["1,30,60,10,55,20", "1,30,60,20,80,20", "2,30,60,10,90,40"],
         {"inner_radius_m": 0.03, "outer_radius_m": 0.06, "angle_rad": np.pi / 18,
          "torque_Nm": 0.55, "load_N": 20.0}),
    ],
    ids=["plates", "german", "imperial", "ring"],
)  # fmt: skip
def test_names_and_units(header, rows, expected, tmp_path):
    found = read_soil_tests(written(tmp_path, "\n".join([header, *rows]), "utf-16"))
    assert len(set(found.table["test"])) == 2 and not found.left_out
    assert {*found.table.columns} == {"test", *expected}
    for name, first in expected.items():
        assert found.table[name][0] == pytest.approx(first, rel=1e-6)


def test_what_is_no_table_of_tests_is_not_taken(tmp_path):
    rows = ["0.1,60,1.2", "0.2,60,2.0", "0.3,60,2.4"]
    assert read_soil_tests(written(tmp_path, "\n".join(["slip,Fz [N],T [N m]", *rows]))) is None
    ours = ["test,plate_radius_m,sinkage_m,pressure_Pa", "1,2,3,4", "1,2,3,4", "1,2,3,4"]
    assert read_soil_tests(written(tmp_path, "\n".join(ours))) is None
    assert read_soil_tests(written(tmp_path, "nothing")) is None


def test_a_column_without_unit_is_asked_for_it(tmp_path):
    rows = ["50,2.5,12", "50,5,20", "75,2.5,11"]
    with pytest.raises(InputError, match="'sinkage' states no unit; needed is one in its name"):
        read_soil_tests(written(tmp_path, "\n".join(["b [mm],sinkage,p [kPa]", *rows])))


def test_the_command_says_what_it_took_and_leaves_out(tmp_path, capsys):
    lines = ["Test,b [mm],z [mm],p [kPa],T air [C]"]
    for test, radius in (("A", 50), ("B", 75), ("C", 100)):
        for z in range(2, 30, 4):
            lines.append(f"{test},{radius},{z},{1.5e3 * (z / 1000) ** 1.1:.4f},21.{z}")
    assert main(["bevameter", str(written(tmp_path, "\n".join(lines)))]) == 0
    out, err = capsys.readouterr()
    assert "plate_radius_m = 'b' (mm), sinkage_m = 'z' (mm), pressure_Pa = 'p' (kPa)" in err
    assert "left out: 'T air'" in err and "kphi" in out
    # values are held to the same limits as those of our own columns
    assert (
        main(["bevameter", str(written(tmp_path, "\n".join(lines).replace("B,75", "B,-1")))]) == 2
    )
    assert "column plate_radius_m: -0.001 given" in capsys.readouterr().err


#: Strengths under 2, 5 and 10 kPa of 0.2 kPa and 32 degrees, as instruments write them.
STRENGTHS = {
    "units in a second row": ["Ring shear,,", "Material,Normal stress,Shear stress", ",kPa,kPa",
                              *(f"A,{s},{0.2 + 0.62487 * s}" for s in (2, 5, 10))],
    "peak and residual": ["No.;Normal stress;Residual shear strength;Peak shear strength",
                          ";[kPa];[kPa];[kPa]",
                          *(f"{s};{s};0,5;{0.2 + 0.62487 * s}".replace(".", ",")
                            for s in (2, 5, 10))],
    "largest torque of an annulus": [
        "inner radius (mm),outer radius (mm),normal load (N),max torque (N m)",
        *(f"150,200,{1e3 * s * np.pi * (0.2**2 - 0.15**2)},"
          f"{1e3 * (0.2 + 0.62487 * s) * 2 * np.pi / 3 * (0.2**3 - 0.15**3)}" for s in (2, 5, 10)),
    ],
    "a yield locus": ["sigma_pre [kPa],tau_pre [kPa],sigma_sh [kPa],tau_sh [kPa]",
                      *(f"20,9,{s},{0.2 + 0.62487 * s}" for s in (2, 5, 10))],
}  # fmt: skip


@pytest.mark.parametrize("lines", STRENGTHS.values(), ids=STRENGTHS)
def test_strengths_alone_give_cohesion_and_friction(lines, tmp_path, capsys):
    path, out = written(tmp_path, "\n".join(lines)), tmp_path / "soil.json"
    picture = tmp_path / "s.png"
    words = ["bevameter", str(path), "--json", str(out), "--picture", str(picture)]
    assert main([*words, "--out", str(tmp_path / "soil.toml")]) == 0
    found = json.loads(out.read_text())
    assert found["estimates"]["cohesion"]["value"] == pytest.approx(200.0, rel=0.01)
    assert found["estimates"]["friction_angle"]["value"] == pytest.approx(np.radians(32), rel=1e-3)
    assert "shear_modulus" not in found["estimates"] and "shear_modulus" not in found["soil"]
    assert [t["shear_modulus_m"] for t in found["shear_tests"]] == [None] * 3
    codes = {remark["code"]: remark["about"] for remark in found["remarks"]}
    assert codes["not-measured"] == ["shear_modulus"]
    printed, err = capsys.readouterr()
    assert "not measured" in printed and "lacks shear_modulus" in err
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_strengths_keep_the_shear_modulus_of_a_model_file(tmp_path):
    path = written(tmp_path, "\n".join(STRENGTHS["units in a second row"]))
    model, out = tmp_path / "model.toml", tmp_path / "soil.toml"
    model.write_text(MODEL)
    assert main(["bevameter", str(path), "--model", str(model), "--out", str(out)]) == 0
    before, after = read_case(model), read_case(out)
    assert after.soil.shear_modulus == before.soil.shear_modulus
    assert after.prior.get("shear_modulus") == before.prior.get("shear_modulus")
    assert after.soil.cohesion == pytest.approx(200.0, rel=0.01)


def test_a_bad_table_does_not_take_the_others_along(tmp_path, capsys):
    good = written(tmp_path, "\n".join(STRENGTHS["a yield locus"]))
    bad, out = tmp_path / "plates.csv", tmp_path / "soil.json"
    bad.write_text("test,sinkage_m\na,0.01\n")
    assert main(["bevameter", str(bad), str(good), "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    (remark,) = [r for r in found["remarks"] if r["code"] == "table-left-out"]
    assert remark["about"] == [str(bad)] and "cohesion" in found["soil"]
    assert main(["bevameter", str(bad)]) == 2
    # tables of a kind are taken together, and tests of one name in two of them are two
    other = tmp_path / "more.csv"
    other.write_text(good.read_text())
    assert main(["bevameter", str(good), str(other), "--json", str(out)]) == 0
    assert len({t["test"] for t in json.loads(out.read_text())["shear_tests"]}) == 6
    assert main(["bevameter", str(good), str(good)]) == 2
    assert "given twice" in capsys.readouterr().err
