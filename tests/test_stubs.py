"""Type checkers know every public name, also those that are loaded on first use."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import soilml
from soilml.physics.effects import EFFECTS

SOURCE = Path(__file__).parents[1] / "soilml"
#: A user's script; the types that a checker must see, in order.
SCRIPT = """\
import soilml
from soilml import Estimator, Model, SlipSinkage, Wheel, identify, read_case, read_table, soil
from soilml.log_import import import_log
case, table = read_case("model.toml"), read_table("runs.csv")
reveal_type(case)
reveal_type(identify(case, table))
reveal_type(Model(Wheel(radius=0.1, width=0.1)) + SlipSinkage(n1=0.4))
reveal_type(soil("wong1989/dry_sand"))
reveal_type(import_log(["a.csv"], "map.toml").table)
reveal_type(Estimator.load("wheel.onnx"))
"""
TYPES = ("Case", "Fit", "Model", "Soil", "Table", "Estimator")


def test_a_stub_has_the_names_that_are_loaded_on_first_use():
    path = SOURCE / "log_import/__init__.pyi"
    stated = {
        alias.asname: node.module
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    assert stated == importlib.import_module("soilml.log_import")._HOME


def test_every_public_name_can_be_imported():
    for name in soilml.__all__:
        assert getattr(soilml, name) is not None
    with pytest.raises(AttributeError, match="soilml has no 'read_tabel'"):
        _ = soilml.read_tabel


@pytest.mark.slow
def test_a_type_checker_sees_the_types_of_a_users_script(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        SCRIPT
        + "".join(f"reveal_type(soilml.{cls.__name__})\n" for cls in EFFECTS.values())
        + "soilml.read_tabel\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", str(script)],
        cwd=SOURCE.parent, capture_output=True, text=True,
    )  # fmt: skip
    lines = [line.partition("script.py:")[2] for line in done.stdout.splitlines()]
    seen = [line.split('"')[1] for line in lines if "Revealed type" in line]
    assert [text.rpartition(".")[2] for text in seen[: len(TYPES)]] == list(TYPES), done.stdout
    for text, cls in zip(seen[len(TYPES) :], EFFECTS.values(), strict=True):
        assert text.endswith(cls.__name__)
    errors = [line for line in lines if line.partition(":")[2].startswith(" error:")]
    assert len(errors) == 1 and '"read_tabel"' in errors[0], done.stdout
