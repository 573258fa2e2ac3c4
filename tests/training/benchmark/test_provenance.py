"""Provenance of test data and model files in a comparison."""

from dataclasses import replace

import pytest
from conftest import MODEL

from soilml import Estimator, read_case, read_table
from soilml.errors import InputError
from training.benchmark.user_comparison import check_same_provenance

NAMES = ("cohesion", "friction_angle", "shear_modulus")
OTHERS = {
    "soil": (MODEL.replace("dry_sand", "sandy_loam_32"), ", the model file"),
    "bearing": (
        MODEL.replace("[soil.prior]", "kphi = 1e6\n[soil.prior]"),
        "the model file has 1e+06",
    ),
    "effect": (MODEL + '[[effect]]\nname = "slip-sinkage"\nn1 = 0.4\n', "effects none"),
    "prior": (MODEL.replace("3000.0", "6000.0"), "prior [0.0, 3000.0] of cohesion"),
    "scale": (
        MODEL.replace("[0.005, 0.03]", '{ range = [0.005, 0.03], scale = "log" }'),
        "of shear_modulus",
    ),
    "gear": (MODEL.replace('"wheel"', '"linear-wheel"'), "gear type 'wheel'"),
    "wheel": (MODEL.replace("radius = 0.15", "radius = 0.1"), "radius 0.15"),
}


@pytest.fixture
def parts(tmp_path, small_data, small_model):
    table = read_table(small_data)
    return table.rows(slice(0, 100)), {"small": Estimator.load(small_model)}


def case_of(tmp_path, text):
    (tmp_path / "m.toml").write_text(text)
    return read_case(tmp_path / "m.toml")


@pytest.mark.parametrize("what", OTHERS)
def test_without_a_recipe_of_the_data_the_training_differences_are_noted(tmp_path, parts, what):
    text, fragment = OTHERS[what]
    table, estimators = parts
    case, table = case_of(tmp_path, text), replace(table, metadata={})
    if what in ("gear", "wheel"):
        with pytest.raises(InputError, match="compare data and models of one wheel"):
            check_same_provenance(case, table, estimators, NAMES)
    else:
        (note, *_) = check_same_provenance(case, table, estimators, NAMES)
        assert (note.code, note.about) == (
            "trained-otherwise",
            ("small",),
        ) and fragment in note.text
