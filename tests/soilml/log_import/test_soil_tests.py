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
        ("Essai;Contrainte normale (kPa);D\u00e9placement horizontal (mm);"
         "Contrainte de cisaillement (kPa)", ["A;2;1;0,5", "A;2;2;0,8", "B;4;1;0,9"],
         {"normal_stress_Pa": 2e3, "shear_displacement_m": 0.001, "shear_stress_Pa": 500.0}),
        ("Di\u00e1metro placa (cm),Hundimiento (cm),Presi\u00f3n (kPa)",
         ["10,1,12", "10,3,20", "15,1,11"],
         {"plate_radius_m": 0.05, "sinkage_m": 0.01, "pressure_Pa": 12e3}),
        ("sigma_n_kPa,dh_mm,tau_kPa", ["2,1,0.5", "2,3,0.8", "4,1,0.9"],
         {"normal_stress_Pa": 2e3, "shear_displacement_m": 0.001, "shear_stress_Pa": 500.0}),
        ("plate radius [mm],plate z [m],Fz [kg]", ["50,-0.01,1", "50,-0.03,2", "75,-0.01,1"],
         {"plate_radius_m": 0.05, "sinkage_m": 0.01, "load_N": 9.80665}),
        ("Normal load (N),Shear force (N),Horiz Disp (mm),Area (cm2)",
         ["7.2,1.8,1,36", "7.2,2.8,3,36", "14.4,3.2,1,36"],
         {"normal_stress_Pa": 2e3, "shear_displacement_m": 0.001, "shear_stress_Pa": 500.0}),
    ],
    ids=["plates", "german", "imperial", "ring", "french", "spanish", "short", "z up", "forces"],
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


@pytest.mark.parametrize(
    ("header", "needed"),
    [("plate z [m],Fz [N]", "the size of the plate is missing"),
     ("dh [mm],shear force [N],normal load [N]", "forces of a shear box need its area")],
)  # fmt: skip
def test_what_is_missing_is_named(header, needed, tmp_path):
    rows = [",".join(["1"] * (header.count(",") + 1)), ",".join(["2"] * (header.count(",") + 1))]
    with pytest.raises(InputError, match=needed):
        read_soil_tests(written(tmp_path, "\n".join([header, *rows, *rows])))


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
    table, draft = str(tmp_path / "tests.csv"), str(tmp_path / "map.toml")
    assert main(["import", table, "--init", "--out", draft]) == 0
    assert f"soilml bevameter {table}" in capsys.readouterr().err
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
    words = ["bevameter", str(path), "--out", str(out), "--picture", str(picture)]
    assert main(words) == 0
    assert main(["bevameter", str(path), "--out", str(tmp_path / "soil.toml")]) == 0
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
    assert main(["bevameter", str(bad), str(good), "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    (remark,) = [r for r in found["remarks"] if r["code"] == "table-left-out"]
    assert remark["about"] == [str(bad)] and "cohesion" in found["soil"]
    assert main(["bevameter", str(bad)]) == 2
    # tables of a kind are taken together, and tests of one name in two of them are two
    other = tmp_path / "more.csv"
    other.write_text(good.read_text())
    assert main(["bevameter", str(good), str(other), "--out", str(out)]) == 0
    assert len({t["test"] for t in json.loads(out.read_text())["shear_tests"]}) == 6
    assert main(["bevameter", str(good), str(good)]) == 2
    assert "given twice" in capsys.readouterr().err


def curves(tests, shape="{s},{x},{tau}", stresses=(25, 50, 100)):
    """Rows of shear tests of 1.5 kPa, 33 degrees and a K of 0.9 mm; displacements in mm."""
    rows = []
    for s in stresses:
        for x in np.arange(0.25, 8.0):
            tau = (1.5 + s * np.tan(np.radians(33))) * (1 - np.exp(-x / 0.9))
            row = shape.format(s=s, x=x, tau=round(tau, 4), up=round(0.02 * x + 0.04, 4))
            rows.append(f"N{s},{row}" if tests else row)
    return rows


SHEAR = {
    "a vertical displacement beside": [
        "Test,Normal Stress (kPa),Horizontal Displacement (mm),Shear Stress (kPa),"
        "Vertical Displacement (mm)", *curves(True, "{s},{x},{tau},{up}")],
    "the vertical one first": [
        "Vertical Displacement (mm),Normal Stress (kPa),Displacement (mm),Shear Stress (kPa)",
        *curves(False, "{up},{s},{x},{tau}")],
    "no column of tests": ["Normal Stress (kPa),Horizontal Displacement (mm),Shear Stress (kPa)",
                           *curves(False)],
    "a lateral pressure beside": [
        "Horizontal Displacement (mm),Lateral Pressure (kPa),Normal Stress (kPa),"
        "Shear Stress (kPa)", *curves(False, "{x},0,{s},{tau}")],
    "German compounds": ["Normalspannung [kPa],Scherweg [mm],Scherspannung [kPa]",
                         *curves(False)],
}  # fmt: skip


@pytest.mark.parametrize("lines", SHEAR.values(), ids=SHEAR)
def test_shear_tests_of_strangers(lines, tmp_path):
    path, out = written(tmp_path, "\n".join(lines)), tmp_path / "soil.json"
    assert main(["bevameter", str(path), "--out", str(out)]) == 0
    found = {k: e["value"] for k, e in json.loads(out.read_text())["estimates"].items()}
    assert found["cohesion"] == pytest.approx(1500.0, rel=0.02)
    assert found["friction_angle"] == pytest.approx(np.radians(33), rel=0.01)
    if "shear_modulus" in found:
        assert found["shear_modulus"] == pytest.approx(0.9e-3, rel=0.02)


PLATES = {
    "numbered": ("test,plate diameter (mm),sinkage (mm),pressure (kPa)", "{k},{two},{z},{p}"),
    "German": ("Versuch,Plattendurchmesser (mm),Eindringtiefe (mm),Bodenpressung (kPa)",
               "V{k},{two},{z},{p}"),
    "a strip": ("test,strip width (mm),sinkage (mm),pressure (kPa)", "{k},{b},{z},{p}"),
    "not numbered": ("plate radius (mm),z (mm),p (kPa)", "{b},{z},{p}"),
}  # fmt: skip


@pytest.mark.parametrize(("header", "shape"), PLATES.values(), ids=PLATES)
def test_plate_tests_of_strangers(header, shape, tmp_path):
    rows = [
        shape.format(k=k, b=b, two=2 * b, z=z, p=round((9 / b + 1.3) * z**1.1, 5))
        for k, b in enumerate((30, 60, 90)) for z in (4, 8, 16, 30)
    ]  # fmt: skip
    path, out = written(tmp_path, "\n".join([header, *rows])), tmp_path / "soil.json"
    assert main(["bevameter", str(path), "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    assert found["estimates"]["n"]["value"] == pytest.approx(1.1, rel=1e-3)
    assert len(found["plate_tests"]) == 3


def test_one_plate_of_a_simulation_states_its_size_in_the_head(tmp_path):
    rows = [f"{i},{i / 100},{i / 1000},{900 * (i / 1000) ** 1.1:.6f}" for i in range(1, 40)]
    lines = ["# plate radius: 50 mm", "step,time [s],z [m],Fz [N]", *rows]
    out = tmp_path / "soil.json"
    assert main(["bevameter", str(written(tmp_path, "\n".join(lines))), "--out", str(out)]) == 0
    assert json.loads(out.read_text())["estimates"]["n"]["value"] == pytest.approx(1.1, rel=1e-3)


@pytest.mark.parametrize("stress", ["Load cell pressure", "Pressure"])
def test_a_cell_alone_makes_no_triaxial_test(stress, tmp_path):
    path = written(tmp_path, f"Test,Sinkage [mm],{stress} [kPa],Cell pressure [kPa]\n" + "\n".join(
        f"1,{z},{z**0.8:.4f},{z}" for z in range(1, 11)))  # fmt: skip
    found = read_soil_tests(path)
    assert found is not None
    assert np.allclose(found.table["pressure_Pa"], 1e3 * np.arange(1, 11) ** 0.8, rtol=1e-3)


@pytest.mark.parametrize(
    ("header", "kind"),
    [
        ("depth (mm),vane torque (Nm)", "vane"),
        ("Cell pressure (kPa),Deviator stress (kPa)", "triaxial"),
        ("sigma3 [kPa],sigma1 [kPa]", "triaxial"),
    ],
)
def test_other_tests_are_said_not_to_be_read(header, kind, tmp_path, capsys):
    path = written(tmp_path, f"{header}\n10,0.2\n20,0.3\n30,0.4")
    assert main(["bevameter", str(path)]) == 2
    assert f"{kind} tests are not read" in capsys.readouterr().err
