"""Tables in which each row is a steady run, with the names and units of papers."""

import numpy as np
import pytest

from soilml.cli import main
from soilml.errors import InputError
from soilml.log_import import import_log, init_map
from soilml.remarks import texts

PAPER = """\
Test no.;slip (%);T [mN m];T std [mN m];Fz (kgf);z (cm);DP (N);sigma DP (%);pitch (deg)
A1;5;1200;40;6,1;1,1;4;10;0
A1;20;2500;60;6,1;1,4;12;10;0,1
A1;;2500;60;6,1;1,4;12;10;0,1
B2;5;1800;50;9,2;1,4;7;10;0
B2;40;4800;;9,2;2,4;24;10;0
"""


@pytest.fixture
def paper(tmp_path):
    (tmp_path / "paper.csv").write_text(PAPER)
    return tmp_path / "paper.csv"


def imported(log, edits=()):
    text = init_map(log)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (log.parent / "map.toml").write_text(text)
    return import_log(log, log.parent / "map.toml"), text


def test_names_units_and_errors_are_guessed(paper):
    found, text = imported(paper, [('# radius = "0.15 m', 'radius = "0.13 m')])
    rows = found.table
    assert list(rows["run"]) == ["A1", "A1", "B2", "B2"]
    np.testing.assert_allclose(rows["slip"], [0.05, 0.2, 0.05, 0.4])
    np.testing.assert_allclose(rows["load_N"], 9.80665 * np.array([6.1, 6.1, 9.2, 9.2]))
    np.testing.assert_allclose(rows["torque_Nm"], [1.2, 2.5, 1.8, 4.8])
    np.testing.assert_allclose(rows["torque_Nm_std"], [0.04, 0.06, 0.05, np.nan])
    np.testing.assert_allclose(rows["drawbar_pull_N_std"], [0.4, 1.2, 0.7, 2.4])
    np.testing.assert_allclose(rows["sinkage_m"], [0.011, 0.014, 0.014, 0.024])
    assert "time_s" not in rows and "[windows]" not in text and "[time]" not in text
    assert found.runs == 2 and found.bias["torque_Nm"].share == pytest.approx(0.02)
    assert "row 3 of paper.csv is left out: its slip is not known" in texts(found.remarks)


def test_the_command_writes_table_and_report(paper, capsys, monkeypatch):
    monkeypatch.chdir(paper.parent)
    assert main(["import", "--init", "paper.csv", "--out", "map.toml"]) == 0
    assert main(["import", "paper.csv", "--map", "map.toml", "--out", "runs.csv"]) == 0
    told = capsys.readouterr().err
    assert "runs.csv written" in told and "were left out" not in told
    page = (paper.parent / "runs.report.html").read_text()
    assert "each row of the table is a steady run" in page and "The runs over time" not in page


def test_speeds_give_the_slip_and_its_error(tmp_path):
    """omega 2 rad/s at 0.15 m and 0.2 m/s: slip 1/3; an error of 0.006 m/s is one of 0.02."""
    rows = "omega [rad/s],v [m/s],err v [m/s],torque [Nm],Fz [N]\n" + "2,0.2,0.006,3.1,60\n" * 3
    (tmp_path / "t.csv").write_text(rows)
    found, text = imported(tmp_path / "t.csv", [('# radius = "0.15 m', 'radius = "0.15 m')])
    assert 'std = "err v"' in text
    np.testing.assert_allclose(found.table["slip"], 1 / 3)
    np.testing.assert_allclose(found.table["slip_std"], 0.02)


def test_slip_by_another_definition_takes_its_error_along(paper):
    """(r omega - v)/v of 0.2 with a noise of 0.01 is ours of 1/6 with that of 0.01 / 1.2^2."""
    stated = 'column = "slip"\ndefinition = "(r omega - v)/v"\nnoise = 0.01'
    found, _ = imported(paper, [('column = "slip"', stated)])
    assert found.table["slip"][1] == pytest.approx(1 / 6)
    assert found.table["slip_std"][1] == pytest.approx(0.01 / 1.2**2, rel=0.02)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (('unit = "%"', 'unit = "1"'), "probably it is in per cent"),
        (('unit = "mN m"', 'unit = "N m"'), "probably the torque is in mN m"),
        (('column = "DP"', 'column = "DP"\ntare = "rest"'), "needs samples over time"),
        (('std = "T std"', 'std = "Tstd"'), "did you mean 'T std'"),
    ],
)
def test_what_cannot_be_right_is_refused(paper, edit, words):
    with pytest.raises(InputError, match=words):
        imported(paper, [('# radius = "0.15 m', 'radius = "0.13 m'), edit])


def test_a_short_log_over_time_is_no_table_of_steady_runs(tmp_path):
    t = np.arange(100) / 20
    lines = [f"{x:.2f},{2.0:.2f},0.2,3.1,60" for x in t]
    (tmp_path / "log.csv").write_text("\n".join(["t,omega,v,torque,Fz", *lines]))
    assert "each_row" not in init_map(tmp_path / "log.csv")
    numbered = ["no,omega,v,torque,Fz", *(f"{i},{line[5:]}" for i, line in enumerate(lines))]
    (tmp_path / "rows.csv").write_text("\n".join(numbered))
    assert "each_row = true" in init_map(tmp_path / "rows.csv")
