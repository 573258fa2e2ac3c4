"""`soilml gap`: four files, exit statuses, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL as MODEL
from console import check_tables

from soilml.cli import main
from soilml.config.case import read_case
from soilml.io.text_tables import csv_text
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating
from soilml.physics.user_effects import load_effects
from soilml.remarks import Remark

pytestmark = pytest.mark.slow

FILES = ["gap.json", "model.toml", "next_runs.csv", "report.html"]
COLUMNS = ("torque_Nm", "drawbar_pull_N", "sinkage_m")

OWN = '''\
from dataclasses import replace
from typing import Annotated

from soilml.arrays import Real
from soilml.parameters import Parameter
from soilml.physics.effects import Effect, effect


@effect(
    "cable-drag", text="a cable is dragged along", source="own", kind="rig",
    reference={"drag": 20.0}, signs={"drawbar_pull": -1},
    isolate="the same runs without the cable",
)
class CableDrag(Effect):
    """A cable that is dragged along pulls back, the more the wheel slips."""

    drag: Annotated[Real, Parameter("N", 0.0, 200.0, "pull at a slip of one")] = 0.0

    def on_reading(self, force, scene):
        slip = scene.at.slip
        return replace(force, drawbar_pull=force.drawbar_pull - self.drag * slip * slip * slip)
'''


def driven(model_file, effects=(), loads=(40.0, 60.0, 90.0, 140.0), slips=6):
    """Runs, one of each load, with the noise of the sensors, as the text of a table."""
    case = read_case(model_file)
    slip, load = np.tile(np.linspace(0.08, 0.6, slips), len(loads)), np.repeat(loads, slips)
    force = replace(case.model, effects=tuple(effects))(case.soil, Operating(slip=slip, load=load))
    true = np.stack([force.torque, force.drawbar_pull, force.sinkage], axis=1)
    rng = np.random.default_rng(0)
    read = true + np.hypot(0.02 * true, [0.0, 0.2, 0.0]) * rng.standard_normal(true.shape)
    runs = np.repeat([f"r{i}" for i in range(len(loads))], slips)
    rows = {"run": runs, "slip": slip, "load_N": load} | dict(zip(COLUMNS, read.T, strict=True))
    return csv_text(rows)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A model file and tables: runs of a wheel that digs itself in, under one load, two rows."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "model.toml").write_text(MODEL)
    digging = [EFFECTS["slip-sinkage"](n1=0.4)]
    dug = driven(folder / "model.toml", digging)
    (folder / "runs.csv").write_text(dug)
    (folder / "two.csv").write_text("\n".join(dug.splitlines()[:3]) + "\n")
    one = driven(folder / "model.toml", digging, loads=(60.0,) * 4)
    (folder / "one.csv").write_text(one)
    (folder / "quiet.toml").write_text(MODEL[: MODEL.index("[noise]")])
    return folder


@pytest.fixture(scope="module")
def done(inputs, tmp_path_factory):
    """The folder that the analysis of the dug runs wrote."""
    out = tmp_path_factory.mktemp("done") / "deep" / "out"
    before = {p: p.read_bytes() for p in inputs.iterdir()}
    command = ["gap", str(inputs / "model.toml"), str(inputs / "runs.csv"), "--out", str(out)]
    assert main(command) == 0
    assert {p: p.read_bytes() for p in inputs.iterdir()} == before
    return out


@pytest.fixture(scope="module")
def one_load(inputs, tmp_path_factory):
    """The same of runs under one load."""
    out = tmp_path_factory.mktemp("one_load")
    command = ["gap", str(inputs / "model.toml"), str(inputs / "one.csv"), "--out", str(out)]
    assert main(command) == 0
    return out


def content(folder):
    return json.loads((folder / "gap.json").read_text())


def test_gap_json_has_the_promised_keys(done):
    found = content(done)
    assert {
        "status", "effects", "cause_set", "where", "gap", "soil_before", "soil_after",
        "outside_probability", "next_runs", "seed", "soilml_version",
    } <= set(found)  # fmt: skip
    assert found["status"] == "named" and ["slip-sinkage"] in found["cause_set"]
    (effect,) = found["effects"]
    assert {"name", "parameters", "alternatives", "probability"} <= set(effect)
    assert set(effect["parameters"]["n1"]) == {"value", "std", "unit"}
    assert {"channel", "slip", "load_N", "z", "p"} <= set(found["where"][0])
    assert len(found["where"][0]["slip"]) == len(found["where"][0]["load_N"]) == 2
    assert set(found["gap"]) == {"train", "held_out_runs", "held_out_region"}
    for figures in found["gap"].values():
        assert figures["before"] > figures["after"] > 0.0
    assert set(found["soil_before"]) == set(found["soil_after"])
    assert found["seed"] == 0


def test_the_model_that_was_written_carries_what_was_named(done):
    case = read_case(done / "model.toml")
    (effect,) = case.model.effects
    found = content(done)
    assert effect.name == found["effects"][0]["name"]
    assert effect.n1 == pytest.approx(found["effects"][0]["parameters"]["n1"]["value"], rel=1e-5)
    for name, value in found["soil_after"].items():
        away = abs(float(getattr(case.soil, name)) - value["value"])
        assert away < 1.5 * value["std"]  # the soil by all explanations together


def analysed(inputs, tmp_path, capsys, *arguments):
    """Status of an analysis that ran, and its gap.json."""
    status = main(["gap", *arguments, "--out", str(tmp_path / "out")])
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert written == set(FILES)
    found = content(tmp_path / "out")
    assert status == (3 if found["status"] == "bad-data" else 0)
    said = capsys.readouterr().out
    assert said.startswith(found["sentence"])
    if found["status"] != "bad-data":
        check_tables(said)
    return found


def test_two_rows_are_bad_data(inputs, tmp_path, capsys):
    files = (str(inputs / "model.toml"), str(inputs / "two.csv"))
    found = analysed(inputs, tmp_path, capsys, *files, "--seed", "3")
    assert found["status"] == "bad-data" and found["seed"] == 3
    assert found["effects"] == found["cause_set"] == found["next_runs"] == []
    assert any("6 readings for 3 soil parameters" in reason["text"] for reason in found["reasons"])
    text = (tmp_path / "out" / "next_runs.csv").read_text()
    assert text.strip() == "run,kind,what,separates_sigma,slip,load_N"


def test_one_load_has_suspects_and_names_nothing(one_load):
    assert sorted(p.name for p in one_load.iterdir()) == sorted(FILES)
    found = content(one_load)
    assert found["status"] == "suspected"
    assert found["effects"] == []
    assert found["reasons"][0]["code"] == "one-load"
    odds = [suspect["log_odds"] for suspect in found["suspects"]]
    assert odds == sorted(odds, reverse=True)
    chance = {tuple(suspect["effects"]): suspect["probability"] for suspect in found["suspects"]}
    assert list(chance.values()) == sorted(chance.values(), reverse=True)
    assert all(found["probabilities"][n[0]] == p for n, p in chance.items() if len(n) == 1)
    kept = [tuple(names) for names in found["cause_set"] if tuple(names) in chance]
    assert kept == [names for names in chance if names in kept] and kept[0] == next(iter(chance))


def test_an_effect_of_ones_own_is_hidden_found_and_written(inputs, tmp_path, capsys):
    own = tmp_path / "own.py"
    own.write_text(OWN)
    with_own = {**EFFECTS, **load_effects(own)}
    runs = tmp_path / "runs.csv"
    runs.write_text(driven(inputs / "model.toml", [with_own["cable-drag"](drag=40.0)], slips=8))
    files = (str(inputs / "model.toml"), str(runs), "--effects", str(own))
    found = analysed(inputs, tmp_path, capsys, *files)
    assert ["cable-drag"] in found["cause_set"]
    text = (tmp_path / "out" / "model.toml").read_text()
    assert 'name = "cable-drag"' in text
    (effect,) = read_case(tmp_path / "out" / "model.toml", with_own).model.effects
    assert effect.drag == pytest.approx(40.0, rel=0.1)


def without_texts(found):
    """The content of gap.json without its sentences: codes, names and figures."""
    if isinstance(found, dict):
        left_out = ("text", "sentence", "description", "report")
        return {k: without_texts(v) for k, v in found.items() if k not in left_out}
    return [without_texts(v) for v in found] if isinstance(found, list) else found


def in_codes(folder):
    """The files of an analysis, and what they say without sentences."""
    return sorted(p.name for p in folder.iterdir()), without_texts(content(folder))


def test_no_decision_is_made_from_the_words_of_a_remark(inputs, done, tmp_path, monkeypatch):
    plain = in_codes(done)
    nonsense = property(lambda self: "load Next runs is not identified", lambda self, text: None)
    monkeypatch.setattr(Remark, "text", nonsense, raising=False)
    names = [str(inputs / "model.toml"), str(inputs / "runs.csv")]
    assert main(["gap", *names, "--out", str(tmp_path / "nonsense")]) == 0
    assert in_codes(tmp_path / "nonsense") == plain
    assert "Next runs is not" in (tmp_path / "nonsense" / "gap.json").read_text()
