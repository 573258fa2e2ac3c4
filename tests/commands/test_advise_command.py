"""`soilml plan next`, and what `identify` says of the next row."""

import pytest
from conftest import MODEL
from console import printed, rows_of

from soilml.cli import main

pytestmark = pytest.mark.slow

RUNS = "run,slip,load_N,torque_Nm\na,0.2,60,2.9\na,0.2,60,2.95\n"


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


def test_the_table_names_the_best_rows_and_what_they_leave(folder, capsys):
    command = [
        "plan",
        "next",
        "model.toml",
        "runs.csv",
        "--slip",
        "0.05,0.6",
        "--load",
        "30,60,120",
    ]
    assert main([*command, "--out", "o.csv", "--picture", "o.png"]) == 0
    assert capsys.readouterr().out.startswith("Measure next: slip 0.6 at 120 N")
    assert (folder / "o.png").read_bytes().startswith(b"\x89PNG")
    rows = rows_of((folder / "o.csv").read_text())
    assert list(rows[0]) == [
        "row", "channels", "slip", "load_N", "cohesion_left", "friction_angle_left",
        "shear_modulus_left", "all_left",
    ]  # fmt: skip
    assert [r["row"] for r in rows] == [
        "best in all", "best for cohesion", "best for friction angle", "best for shear modulus",
    ]  # fmt: skip


def test_the_report_says_what_the_rows_leave_open_and_what_would_tell_it(folder, capsys):
    said = " ".join(printed(["plan", "next", "model.toml", "runs.csv"], capsys).out.split())
    assert "of the prior's width of cohesion; the best row for it leaves" in said
    assert "of shear modulus; the best" not in said
    identified = printed(["identify", "model.toml", "runs.csv", "--method", "posterior"], capsys)
    assert "next: soilml plan next" in identified.out
