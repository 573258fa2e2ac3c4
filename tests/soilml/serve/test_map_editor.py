"""The map of a log on the page: roles, units and values are changed, and the rest stays."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from served_page import ROOT

from soilml.log_import import import_log
from soilml.optional_imports import tomllib
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
