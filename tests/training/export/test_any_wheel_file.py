"""Specs of a file for wheels of any size."""

import pytest

from datagen.recipe import packaged_file
from soilml.cli import main
from soilml.errors import InputError
from training.spec import is_any_wheel_spec, read_any_wheel_spec

SPEC = packaged_file("any_wheel", "training", "specs").read_text()


def spec_of(folder, text):
    path = folder / "spec.toml"
    path.write_text(text)
    return path


def test_the_packaged_spec_is_of_driving_wheels():
    spec = read_any_wheel_spec("any_wheel")
    assert is_any_wheel_spec("any_wheel") and not is_any_wheel_spec("fused")
    assert spec.noise["torque"] == [0.0, 0.02]
    assert spec.family.ranges["slip"].lower > 0.0


@pytest.mark.parametrize("key", ["slip", "wheel_radius", "load", "n", "friction_angle"])
def test_a_range_that_is_missing_is_named(tmp_path, key):
    lines = [line for line in SPEC.splitlines() if not line.startswith(f"{key} =")]
    with pytest.raises(InputError, match=key):
        read_any_wheel_spec(spec_of(tmp_path, "\n".join(lines)))


def test_an_unknown_key_is_named(tmp_path):
    with pytest.raises(InputError, match="hiden"):
        read_any_wheel_spec(spec_of(tmp_path, SPEC.replace("hidden", "hiden")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("designs = 10", "designs"),
        ("designs = 60000000000", "designs"),
        ("designs = -5", "designs"),
        ('designs = "many"', "designs"),
    ],
)
def test_impossible_settings_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_any_wheel_spec(spec_of(tmp_path, SPEC.replace("designs = 60000", text)))


def test_data_are_refused_where_rows_are_simulated(tmp_path, capsys):
    out = tmp_path / "any.onnx"
    assert main(["train", "any_wheel", str(tmp_path / "data.parquet"), str(out)]) == 2
    assert "leave the data out" in capsys.readouterr().err
    assert not out.exists()
