"""Metadata that was changed and signed again: every malformed entry is refused in one line."""

import json
from types import SimpleNamespace

import onnx
import pytest
from compiled_c import ROOT
from signed_files import signed

from soilml import Estimator
from soilml.cli import main
from soilml.onboard import model_file

SOURCE = ROOT / "exported" / "wheel_small.onnx"
RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\na,0.3,60,2.6\n"
ESCAPES = "\x1b[31mwheel\n"


def edited(key, change):
    """The entry of the wheel's file with a change."""
    model = onnx.load(SOURCE)
    content = json.loads({e.key: e.value for e in model.metadata_props}[key])
    change(content)
    return {key: json.dumps(content)}


def of_output(key, value):
    return edited("outputs", lambda outputs: outputs[0].update({key: value}))


def put(key, name, value):
    return edited(key, lambda content: content.update({name: value}))


CHANGES = {
    "a list as unit": of_output("unit", ["a"]),
    "another unit": of_output("unit", "furlong"),
    "a name that is no quantity": of_output("name", "<b>x</b>"),
    "a list as name": of_output("name", ["a"]),
    "a name twice": of_output("name", "friction_angle"),
    "no prior": of_output("prior_std", 0),
    "a text as prior": of_output("lower", "0"),
    "a prior upside down": of_output("lower", 1e9),
    "a prior beyond numbers": of_output("upper", 10**400),
    "a scale with escapes": of_output("scale", ESCAPES),
    "a list as scale": of_output("scale", [1]),
    "an input that cannot be read": edited("inputs", lambda e: e[0].update(name="cohesion")),
    "no inputs": {"inputs": "null"},
    "a gear with escapes": put("gear", "type", ESCAPES),
    "a number as gear": put("gear", "type", 5),
    "a text as radius": put("gear", "radius", "wide"),
    "no radius": put("gear", "radius", float("nan")),
    "a size of the gear with escapes": put("gear", "lug", ESCAPES),
    "a list as gear": {"gear": "[]"},
    "null as gear": {"gear": "null"},
    "a list as recipe": {"recipe": "[]"},
    "a text as effects": put("recipe", "effect", "x"),
    "a number as effect": put("recipe", "effect", [{"name": 5}]),
    "an effect with escapes": put("recipe", "effect", [{"name": ESCAPES}]),
    "a recipe without end": {"recipe": "[" * 100_000},
    "a number as spec": {"spec": "5"},
    "an empty calibration": {"together": "{}"},
    "a calibration of other outputs": put("together", "alone", [1.0]),
    "an empty set": {"set": "{}"},
    "null as set": {"set": "null"},
    "negative noise": put("set", "noise", {"torque": [-1.0, 0.0]}),
    "no number as an error": put("set", "errors", {"slip_bias": float("nan")}),
    "a context with escapes": put("set", "context", {ESCAPES: [0.0, 1.0]}),
    "no probe of a set": edited("probe", lambda probe: probe.__delitem__(slice(1, None))),
    "a number as probe": {"probe": "[5]"},
    **{f"without {key}": {key: None} for key in ("gear", "inputs", "outputs", "recipe", "together",
                                                 "probe", "spec")},
}  # fmt: skip


@pytest.mark.slow
def test_a_malformed_entry_is_refused_by_every_command(tmp_path, capsys, monkeypatch, subtests):
    session = Estimator.load(SOURCE).session  # of the same graph, with other metadata

    def created(content):
        found = {e.key: e.value for e in onnx.load_from_string(content).metadata_props}
        meta = SimpleNamespace(custom_metadata_map=found)
        return SimpleNamespace(run=session.run, get_modelmeta=lambda: meta)

    monkeypatch.setattr(model_file, "create_session", created)
    (tmp_path / "runs.csv").write_text(RUNS)
    others = {"estimate": "runs.csv", "export c": "m.c"}
    for what, change in CHANGES.items():
        file = signed(SOURCE, tmp_path / "m.onnx", **change)
        every = what in ("null as set", "without gear")
        for command, other in others.items() if every else [("estimate", "runs.csv")]:
            with subtests.test(f"{what}, {command}"):
                assert main([*command.split(), str(file), str(tmp_path / other)]) == 2
                captured = capsys.readouterr()
                assert captured.err.count("\n") == 1 and "metadata is damaged" in captured.err
                assert captured.out == "" and "\x1b" not in captured.err
                assert {path.name for path in tmp_path.iterdir()} == {"m.onnx", "runs.csv"}
