"""A question of a design as a file: nothing is assumed, every fault is one line."""

import math

import pytest
from design_files import STUDY

from soilml.errors import InputError
from soilml.rover_design.study import Dimension, read_study


def study_of(tmp_path, text=STUDY):
    path = tmp_path / "rover.toml"
    path.write_text(text)
    return read_study(path)


def test_a_file_is_read_with_its_units(tmp_path):
    study = study_of(tmp_path)
    assert study.varied == ["width", "lug_height"]
    assert study.dimensions["lug_height"] == Dimension((0.0, 0.01))
    assert study.dimensions["width"] == Dimension((0.05, 0.12), searched=True)
    assert study.goal.slope == pytest.approx(math.radians(10.0))
    assert study.goal.risk == 0.05 and study.goal.least == "width"


@pytest.mark.parametrize(
    ("given", "instead", "said"),
    [
        ("mass = 12.0\n", "", r"\[rover\]: mass is missing; needed is a number in kg"),
        ("wheelbase = 0.40\n", "", r"\[rover\]: wheelbase is missing"),
        ("centre_of_mass = [0.02, 0.18]\n", "", r"centre_of_mass is missing"),
        ('gravity = "earth"\n', "", r"gravity is missing; needed is a number in m/s.2"),
        ("radius = 0.09\n", "", r"\[wheel\]: radius is missing"),
        ('slope = "10 deg"\n', "", r"\[goal\]: slope is missing"),
        ('"10 deg"', "10", r"if 10 are degrees, write 0.1745"),
        ("wheels = 4", "wheels = 5", r"wheels is 5; needed is an even number"),
        ("[0.05, 0.12]", "[0.12, 0.05]", r"with lower below upper"),
        ("[0.05, 0.12]", "5", r"width is 5 m; needed is 0.005 to 2"),
        ("width = [0.05", "widht = [0.05", r"misspell it as 'widht'"),
        ('least = "width"', 'least = "cost"', r"least is 'cost'; needed is one of 'energy'"),
        ("ding2015/hit_lss1", "ding2015/hit", r"no soil 'ding2015/hit'"),
        ('name = "ding2015/hit_lss1"', 'names = ["a/b"]', r"no soil 'a/b'"),
        ("{ values = [0.0", "{ value = [0.0", r"\{ values = \[...\] \}"),
    ],
)
def test_what_is_missing_or_wrong_is_one_line(tmp_path, given, instead, said):
    with pytest.raises(InputError, match=said) as caught:
        study_of(tmp_path, STUDY.replace(given, instead))
    assert "\n" not in str(caught.value)
