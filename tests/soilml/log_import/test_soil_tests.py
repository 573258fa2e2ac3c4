"""Plate and shear tests as laboratories write them."""

import numpy as np
import pytest

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
