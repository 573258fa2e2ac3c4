"""Provenance of test data and model files in a comparison."""

import json
from dataclasses import replace

import pytest
from conftest import MODEL

from soilml import Estimator, read_case, read_table
from soilml.cli import main
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


def test_files_of_one_recipe_give_no_notes(tmp_path, parts):
    assert check_same_provenance(case_of(tmp_path, MODEL), *parts, NAMES) == []
    cohesion = MODEL.replace("[soil.prior]", "cohesion = 7.0\n[soil.prior]")
    assert (
        check_same_provenance(case_of(tmp_path, cohesion), *parts, NAMES) == []
    )  # varied in the data


@pytest.mark.parametrize("what", OTHERS)
def test_test_data_of_another_model_file_are_refused(tmp_path, parts, what):
    text, fragment = OTHERS[what]
    with pytest.raises(InputError) as caught:
        check_same_provenance(case_of(tmp_path, text), *parts, NAMES)
    assert fragment in str(caught.value)


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


def test_a_damaged_recipe_is_one_line(tmp_path, parts):
    table, estimators = parts
    for text in ("{", "[]", "[" * 100_000, json.dumps({"gear": 10**400}), '{"gear": {}}'):
        with pytest.raises(InputError):
            check_same_provenance(
                case_of(tmp_path, MODEL),
                replace(table, metadata={"soilml_recipe": text}),
                estimators,
                NAMES,
            )


@pytest.mark.parametrize("sets", ["0", "-5", "many", "9" * 5000])
def test_a_number_of_sets_that_is_not_positive_is_refused(
    tmp_path, small_data, small_model, capsys, sets
):
    (tmp_path / "m.toml").write_text(MODEL)
    command = ["compare", str(tmp_path / "m.toml"), str(small_data), str(small_model)]
    assert main([*command, "--out", str(tmp_path / "o"), f"--analytic-sets={sets}"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "o").exists()
