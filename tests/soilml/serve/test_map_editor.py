"""The map of a log on the page: roles, units and values are changed, and the rest stays."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from served_page import ROOT

from soilml.errors import InputError
from soilml.log_import import import_log
from soilml.log_import.guesses.map_edits import open_lines, set_unit, set_value
from soilml.optional_imports import tomllib
from soilml.serve.answers.logs import look
from soilml.serve.answers.map_editor import edit

sys.path.insert(0, str(ROOT / "examples" / "import"))


def silent(*stage):
    """Progress that nobody sees."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log of the example, whose rotation is that of the motor."""
    from rig import write_logs

    return write_logs(tmp_path_factory.mktemp("rig"))[0]


@pytest.fixture
def ask(log, tmp_path, monkeypatch):
    """Ask the editor in a folder that holds the log, as a job does."""
    shutil.copy(log, tmp_path)
    monkeypatch.chdir(tmp_path)
    return lambda **request: edit({"names": [Path(log).name], **request}, silent)


def by_name(answer):
    return {column["name"]: column for column in answer["columns"]}


def test_columns_have_the_roles_and_units_of_the_guesses(ask):
    answer = ask()
    columns = by_name(answer)
    found = {name: (c["role"], c["unit"]) for name, c in columns.items()}
    assert found == {
        "Zeit": ("time", ""), "Motor Position": ("wheel_angle", "°"), "Fz": ("load", "N"),
        "Wagen Position": ("position", "mm"), "Drehmoment": ("torque", "mNm"),
        "Fx": ("drawbar_pull", "N"),
    }  # fmt: skip
    assert all(len(c["spark"]) == 60 for c in columns.values())
    (line,) = answer["open"]
    assert (line["table"], line["key"], line["value"]) == ("wheel_angle", "gear_ratio", "1")


def test_what_physics_objects_to_is_said_beside_its_role(ask):
    hints = ask()["preview"]["hints"]
    wrong = [hint for hint in hints if hint["wrong"]]
    assert wrong[0]["about"] == ["wheel_angle"] and "gearbox" in wrong[0]["text"]


def test_a_value_is_set_and_the_curves_are_those_of_the_import(ask):
    answer = ask()
    answer = ask(map=answer["map"], change={"line": answer["open"][0]["line"], "value": "99"})
    assert answer["open"] == [] and not any(h["wrong"] for h in answer["preview"]["hints"])
    slip, load, torque = answer["preview"]["curves"]
    Path("own.toml").write_text(answer["map"])
    rows = import_log(sorted(Path().glob("*.csv")), "own.toml").table
    assert answer["preview"]["rows"] == len(rows)
    for curve, name in ((slip, "slip"), (load, "load_N"), (torque, "torque_Nm")):
        values = np.asarray(curve["steady"])
        at = np.asarray(curve["time"])
        steady = [values[np.abs(at - t) < 1.0] for t in rows["time_s"]]
        means = [np.nanmean(own) for own in steady]
        np.testing.assert_allclose(means, rows[name], atol=0.05 * np.ptp(rows[name]) + 0.3)


def test_a_column_of_another_role_gets_its_sign_and_tare(ask):
    answer = ask()
    text = answer["map"].replace('shortest = "2 s"', 'shortest = "3 s"')
    answer = ask(map=text, change={"column": "Fx", "role": "load"})
    found = tomllib.loads(answer["map"])
    assert found["load"] == {"column": "Fx", "unit": "N", "bias": "1 %"}  # and no reverse
    assert "drawbar_pull" not in found and found["windows"]["shortest"] == "3 s"
    assert by_name(answer)["Fz"]["role"] == ""
    answer = ask(map=answer["map"], change={"column": "Fz", "role": "load"})
    found = tomllib.loads(answer["map"])
    assert found["load"]["reverse"] is True and "it is negative in the log" in answer["map"]
    answer = ask(map=answer["map"], change={"column": "Fz", "role": ""})
    assert "load" not in tomllib.loads(answer["map"])
    assert "the load is missing" in answer["preview"]["error"]


def test_a_unit_is_chosen(ask):
    answer = ask()
    answer = ask(map=answer["map"], change={"role": "load", "unit": "kgf"})
    assert tomllib.loads(answer["map"])["load"]["unit"] == "kgf"
    assert tomllib.loads(answer["map"])["load"]["reverse"] is True
    answer = ask(map=answer["map"], change={"role": "load", "unit": "furlong"})
    assert "furlong" in answer["preview"]["error"] and len(answer["columns"]) == 6


def test_a_fault_of_the_map_leaves_the_columns(ask):
    text = ask()["map"].replace('column = "Fz"', 'column = "Fy"')
    answer = ask(map=text)
    assert "'Fy'" in answer["preview"]["error"] and len(answer["columns"]) == 6
    with pytest.raises(InputError, match=r"no valid TOML.*line 3"):
        ask(map="[load]\ncolumn = 'Fz'\nunit = \n")


def test_what_cannot_be_changed_is_said(ask):
    text = ask()["map"]
    for change in ({"column": "none", "role": "load"}, {"column": "Fx", "role": "colour"}):
        with pytest.raises(InputError, match="not known"):
            ask(map=text, change=change)
    for change in ({"line": 1, "value": "3"}, {"line": 9999, "value": "3"}, {"line": "x"}):
        with pytest.raises(InputError, match="needed is"):
            ask(map=text, change=change)
    with pytest.raises(InputError, match=r"has no \[sinkage\]"):
        set_unit(text, "sinkage", "mm")


def test_a_wheel_of_several_is_changed_alone(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    t = np.arange(0, 20, 0.05)
    names = ["t", "v", "fl_omega", "fr_omega", "fl_torque", "fr_torque", "fl_other"]
    rows = np.column_stack([t, 0.1 + 0 * t, *rng.normal(1.0, 0.01, (5, t.size))])
    text = "\n".join([",".join(names), *(",".join(f"{x:.5f}" for x in row) for row in rows)])
    (tmp_path / "log.csv").write_text(text)
    monkeypatch.chdir(tmp_path)
    answer = edit({"names": ["log.csv"]}, silent)
    assert by_name(answer)["fl_torque"]["role"] == "wheels.front_left.torque"
    change = {"column": "fl_other", "role": "wheels.front_left.torque"}
    answer = edit({"names": ["log.csv"], "map": answer["map"], "change": change}, silent)
    wheels = tomllib.loads(answer["map"])["wheels"]
    assert wheels["front_left"]["torque"]["column"] == "fl_other"
    assert wheels["front_right"]["torque"]["column"] == "fr_torque"
    assert by_name(answer)["fl_torque"]["role"] == ""


def test_without_a_radius_load_and_torque_are_drawn(ask):
    text = ask()["map"]
    start = text.index("radius =")
    text = text[:start] + "# " + text[start:]
    preview = ask(map=text)["preview"]
    assert "radius" in preview["error"]
    assert [c["quantity"] for c in preview["curves"]] == ["load", "torque"]
    load = np.asarray(preview["curves"][0]["steady"])
    assert np.nanmean(load) == pytest.approx(40.0, abs=1.0)


@pytest.mark.parametrize("name", ["a_line_per_reading", "pull_curves"])
def test_columns_of_other_kinds_of_logs(tmp_path, monkeypatch, name):
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "soilml" / "log_import"))
    import described_rigs
    import foreign_rigs

    write = getattr(foreign_rigs, name, None) or getattr(described_rigs, name)
    write(np.random.default_rng(0), tmp_path)
    monkeypatch.chdir(tmp_path)
    answer = edit({"names": sorted(f.name for f in tmp_path.iterdir())}, silent)
    assert sum(bool(c["role"]) for c in answer["columns"]) >= 3
    assert all(len(c["spark"]) > 2 for c in answer["columns"])
    assert "no recording" not in answer["preview"]["error"]


MAP = """# Map
# CHANGE and NEEDED first

[wheel]
# radius = "0.15 m +- 1 %"  # NEEDED; travel over rotation is 0.118 m

# [vehicle]   # NEEDED, or [load]
# mass = "6 kg"

[torque]
column = "T"  # CHANGE: its name alone does not say so
"""


def test_lines_that_need_a_look_are_listed_and_set():
    found = [(o.line, o.table, o.key, o.unset) for o in open_lines(MAP)]
    assert found == [
        (5, "wheel", "radius", True), (7, "wheel", "", True), (11, "torque", "column", False)
    ]  # fmt: skip
    text = set_value(MAP, 5, "0.12 m +- 2 %")
    assert 'radius = "0.12 m +- 2 %"\n' in text and len(open_lines(text)) == 2
    assert "radius = 0.2\n" in set_value(MAP, 5, " 0.2 ")
    with pytest.raises(InputError, match="needed is a value"):
        set_value(MAP, 5, " ")


def test_a_spreadsheet_is_looked_at_by_its_sheet(tmp_path, monkeypatch):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["run", "slip", "load_N", "torque_Nm"], ["a", 0.1, 60, 2]):
        book.active.append(row)
    book.create_sheet("log").append(["t"])
    book.save(tmp_path / "tests.xlsx")
    monkeypatch.chdir(tmp_path)
    found = look({"names": ["tests.xlsx"]}, silent)
    assert found == {"kind": "sheets", "sheets": ["Sheet", "log"]}
    assert look({"names": ["tests.xlsx#Sheet"]}, silent)["rows"] == 1
    assert look({"names": ["tests.xlsx#log"]}, silent) == {"kind": "log"}
