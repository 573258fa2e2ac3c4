"""`soilml init`, `soilml show models` and `soilml setup check`, and short names of files."""

import pytest
from console import refused

from soilml import read_case, soil_catalogue
from soilml.cli import main
from soilml.onboard.model_file import released_models


@pytest.mark.parametrize("soil", [[], ["--soil", "wong1989/dry_sand"]])
def test_the_first_model_file_is_one(tmp_path, capsys, soil):
    file = tmp_path / "model.toml"
    assert main(["init", str(file), "--radius", "0.1", "--width", "0.08", *soil]) == 0
    case = read_case(file)
    assert (case.model.gear.radius, case.model.gear.width) == (0.1, 0.08)
    assert case.noise["torque_Nm"].share == 0.02
    assert {"cohesion", "friction_angle", "shear_modulus"} <= set(case.prior)
    assert ("kphi" in case.prior) == (not soil)
    assert "Next: soilml identify" in capsys.readouterr().out


@pytest.mark.slow
def test_models_lists_them(capsys):
    assert main(["show", "models"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in lines if line} >= set(released_models())
    assert any(line.startswith("wheel ") and "wheel 150, 120" in line for line in lines)
    assert max(map(len, lines)) <= 80


@pytest.mark.slow
def test_doctor_finds_nothing_wrong_here_and_says_what_is_missing(capsys, monkeypatch):
    assert main(["setup", "check"]) == 0
    assert "nothing is wrong" in capsys.readouterr().out
    monkeypatch.setattr("soilml.cli.commands.doctor._version", lambda name: "")
    assert main(["setup", "check"]) == 1
    assert "! onnxruntime is missing: pip install onnxruntime" in capsys.readouterr().out


def test_init_takes_sizes_with_their_units(workplace, capsys):
    for file, radius, width in (("a.toml", "150 mm", "12 cm"), ("b.toml", "0.15", "0.12")):
        assert main(["init", file, "--radius", radius, "--width", width]) == 0
    assert (workplace / "a.toml").read_text() == (workplace / "b.toml").read_text()
    words = ["init", "c.toml", "--radius", "15 inch", "--width", "0.1"]
    needed = "needed is a number in m, or a text with one of the units m"
    refused(words, capsys, f"--radius is '15 inch'; {needed}", workplace)


def test_priors_of_init_reach_beyond_the_published_values_of_every_soil(tmp_path):
    for i, (name, entry) in enumerate(soil_catalogue().items()):
        file = tmp_path / f"{i}.toml"
        assert main(["init", str(file), "--radius", "0.1", "--width", "0.08", "--soil", name]) == 0
        prior = read_case(file).prior
        for parameter in ("cohesion", "friction_angle", "shear_modulus"):
            low, high = prior[parameter].lower, prior[parameter].upper
            value = getattr(entry.soil, parameter)
            assert value == low == 0.0 or 1.09 * low < value < 0.91 * high, (name, parameter)
