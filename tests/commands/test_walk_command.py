"""`soilml walk`: wheel-legs on soft ground, as tables and pictures."""

import numpy as np
import pytest
from console import refused, rows_printed

SOFT, FIRM = "0.4e6", "1e6"


def test_a_row_for_each_combination_and_firm_ground_carries_better(tmp_path, capsys):
    picture = tmp_path / "feet.png"
    command = ["paper", "walk", "--foot", "LTF,CIF", "--stiffness", f"{SOFT},0.7e6,{FIRM}"]
    found = rows_printed([*command, "--picture", picture], capsys)
    assert [(row["foot"], float(row["stiffness_N_m3"])) for row in found] == [
        (foot, stiffness) for foot in ("LTF", "CIF") for stiffness in (4e5, 7e5, 1e6)
    ]
    sunk = np.asarray([float(row["sinkage_mean_m"]) for row in found]).reshape(2, 3)
    assert (np.diff(sunk, axis=1) < 0.0).all()  # firmer ground
    assert (sunk[1] < sunk[0]).all()  # a larger foot
    for row in found:
        assert float(row["sinkage_mean_m"]) < float(row["sinkage_largest_m"])
        assert row["status"] == "ok" and row["slip_commanded"] == ""
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--foot", "XYZ"], "no foot 'XYZ'; there are: none, LTF, SRF, CIF"),
        (["--ground", "mud"], "no ground 'MUD'; there are: SSC-1"),
        (["--legs", "2.5"], "needed are whole numbers"),
        (["--legs", "9"], "9 legs; the model is for 1 to 6"),
        (["--slip", "0,50"], "--slip is 50; needed is 1 - v/(r omega)"),
        (["--stiffness", "1e6", "--ground", "SSC-1"], "in place of --ground"),
        (["--stiffness", "1e6"], "a picture needs three or more values"),
        (["--stiffness", "1e5:1e6:200", "--legs", "3:6:4"], "800 walks; at most 400"),
    ],
)
def test_bad_requests_are_refused_in_one_line(options, expected, tmp_path, capsys):
    files = ["--out", tmp_path / "walks.csv", "--picture", tmp_path / "walks.png"]
    refused(["paper", "walk", *options, *files], capsys, expected, tmp_path)
